// SPDX-License-Identifier: Apache-2.0
// The frames of one moving camera in order of time, reduced: where things move is seen well enough
// in small images, and their optical flow is quick.
#pragma once
#include <vector>

#include "optim/flow/optical_flow.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

struct SmallVideo {
  std::vector<const Frame*> frames;
  std::vector<Camera> cameras;  // one per frame, of the small images
  std::vector<Image> images;    // RGB

  size_t size() const { return frames.size(); }
  int width() const { return cameras[0].width; }
  int height() const { return cameras[0].height; }
};

// The training frames, with at most 400 pixels along the longer side.
SmallVideo small_video(const Scene& scene, FrameStore& store);

// Optical flow from frame i to j and back.
std::pair<TargetFlow, TargetFlow> quick_flows(const SmallVideo& video, size_t i, size_t j);

}  // namespace gflow
