// SPDX-License-Identifier: Apache-2.0
// Pixels of a moving camera's frames whose optical flow no point at rest explains.
#pragma once
#include "optim/formats/ply.hpp"
#include "optim/movers/masks.hpp"
#include "optim/movers/small_video.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

struct Suspects {
  std::vector<Mask> masks;  // one per frame, with a margin
  PointCloud points;        // of pixels that a point at rest explains well
};

// From each pixel, flow leads to frames 2, 4 and 8 before and after. A point at rest is where the
// rays of all these pixels meet; the distance between its projections and the pixels, in pixels,
// says how badly. Edges of what is near are among the suspects as well, because flow is wrong
// there: a model of what rests must decide. points: at most `most_points`.
Suspects suspects_of(const SmallVideo& video, size_t most_points, const ProgressCallback& progress);

}  // namespace gflow
