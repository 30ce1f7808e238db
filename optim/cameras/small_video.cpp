// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/small_video.hpp"

#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

constexpr int kSide = 400;  // of the longer side [px]

}  // namespace

SmallVideo small_video(const Scene& scene, FrameStore& store) {
  SmallVideo video;
  for (const Frame& frame : scene.train) video.frames.push_back(&frame);
  std::stable_sort(video.frames.begin(), video.frames.end(),
                   [](const Frame* a, const Frame* b) { return a->time < b->time; });
  for (const Frame* frame : video.frames) {
    video.cameras.push_back(limited(store.camera(*frame), kSide));
    video.images.push_back(resized(*store.rgb(*frame), video.width(), video.height()));
  }
  return video;
}

std::pair<TargetFlow, TargetFlow> quick_flows(const SmallVideo& video, size_t i, size_t j) {
  return estimate_quick_flows(video.images[i], video.images[j]);
}

}  // namespace gflow
