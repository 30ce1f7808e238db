// SPDX-License-Identifier: Apache-2.0
// The things that move in a video: their pixels over time, and how far away they are.
#pragma once
#include "optim/movers/background.hpp"

namespace gflow {

struct Mover {
  std::vector<Mask> masks;     // one per frame; empty masks where it is out of view
  std::vector<double> depths;  // of its middle at each frame, along the axis [scene units]; 0: none
};

// Neighbouring frames, with flow there and back between frame i and i + 1.
using NeighbourFlows = std::vector<std::pair<TargetFlow, TargetFlow>>;
NeighbourFlows neighbour_flows(const SmallVideo& video);

// Links the moving parts of neighbouring frames by their flow, and finds the depth of each chain:
// images of one camera tell it only together with an assumption. It moves as little as its rays
// allow, but stays in front of what it hides: the depths d minimise the squared motion of its
// pixels from frame to frame, sum |c' + d' r' - c - d r|^2 over frames 1, 2 and 4 apart with the
// mean rays r of the same pixels and camera centres c, and change smoothly; no d is larger than the
// smallest depths of the background in its mask. If most would be less than 0.4 of that, the camera
// follows the mover, for which least motion is close to the camera: then it is where it would touch
// what it hides. Movers of few pixels are left out.
std::vector<Mover> movers_of(const SmallVideo& video, const StillBackground& background,
                             const NeighbourFlows& flows);

}  // namespace gflow
