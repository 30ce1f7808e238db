// SPDX-License-Identifier: Apache-2.0
// Paths of surface points of what moves, over the whole video: initial Gaussians and how they move.
#pragma once
#include "optim/movers/movers.hpp"

namespace gflow {

// Paths are chosen in at most so many frames of the video. Gaussians that are not permanent last
// from one to the next: their standard deviation over time, in lengths of the video.
constexpr size_t kChosenFrames = 12;
constexpr float kPathLifetime = 0.5f / float(kChosenFrames);

struct Paths {
  std::vector<double> times;    // [frames] in [0, 1]
  std::vector<float> xyz;       // [n, frames, 3] world
  std::vector<uint8_t> seen;    // [n, frames]; 1: in view, 0: as its neighbours move
  std::vector<int> first_seen;  // [n] frame in which it was chosen
  std::vector<uint8_t> rgb;     // [n, 3] colour there
  std::vector<float> size;      // [n] distance to its neighbours there [scene units]
  size_t count() const { return first_seen.size(); }
  size_t frames() const { return times.size(); }
  const float* at(size_t i, size_t frame) const { return &xyz[3 * (i * frames() + frame)]; }
  bool is_seen(size_t i, size_t frame) const { return seen[i * frames() + frame]; }
};

// About `wanted` pixels of the movers in some frames, evenly spaced, carried on by flow as long as
// it stays on the mover, at the mover's depth. Where a path is out of view it continues as the
// nearest ones in view do.
Paths paths_of(const SmallVideo& video, const std::vector<Mover>& movers,
               const NeighbourFlows& flows, size_t wanted);

}  // namespace gflow
