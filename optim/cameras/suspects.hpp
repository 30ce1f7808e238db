// SPDX-License-Identifier: Apache-2.0
// Pixels of a moving camera's frames whose optical flow no point at rest explains.
#pragma once
#include <array>

#include "optim/cameras/masks.hpp"
#include "optim/cameras/small_video.hpp"
#include "optim/formats/ply.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

struct SuspectOptions {
  size_t most_points = 0;                   // about as many points at most
  std::array<size_t, 3> spans = {2, 4, 8};  // of flow, before and after each frame [frames]
  double least_parallax = 0.03;             // angle between the rays to a point [rad]
  bool with_margin = true;                  // of the masks
};

struct Suspects {
  std::vector<Mask> masks;  // one per frame
  PointCloud points;        // of pixels that a point at rest explains well
};

// From each pixel, flow leads to frames before and after. A point at rest is where the rays of all
// these pixels meet; the distance between its projections and the pixels, in pixels, says how
// badly. Edges of what is near are among the suspects as well, because flow is wrong there: a model
// of what rests must decide.
Suspects suspects_of(const SmallVideo& video, const SuspectOptions& options,
                     const ProgressCallback& progress);

// Masks of suspects without single pixels, and with what is next to them.
Mask with_margin(const Mask& suspects);

}  // namespace gflow
