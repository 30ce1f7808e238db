// SPDX-License-Identifier: Apache-2.0
// The work of an image, counted.
#pragma once
#include "optim/engine/engine.hpp"

namespace gflow::bench {

// Pairs of a pixel and a splat: in the lists of the tiles, in cells the masks name, and blended.
struct Pairs {
  double listed = 0, masked = 0, blended = 0;
};

// Of the engine's last image; settings are those it was made with.
Pairs count_pairs(Queue& queue, const Engine& engine, const EngineSettings& settings);

// Useful operations of a blended pair, an FMA being two: what the formulas of shared/pixel.h need
// when nothing is wasted on lanes that do not count.
double forward_flops(Channels channels);
double backward_flops(Channels channels);

}  // namespace gflow::bench
