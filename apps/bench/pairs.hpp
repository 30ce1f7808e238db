// SPDX-License-Identifier: Apache-2.0
// The work of an image, counted.
#pragma once
#include "optim/engine/engine.hpp"

namespace gflow::bench {

// Pairs of a pixel and a splat: in the lists of the tiles, in cells the masks name, blended; and on
// the way back, in cells the masks name and that ask. Lists are walked as far as skip.saturated
// lets; `listed` counts them whole.
struct Pairs {
  double listed = 0, masked = 0, blended = 0, back = 0;
};

// Of the engine's last image; settings are those it was made with, v (nullptr: all ask) the
// gradients that went back, of v_flow if `flow`.
Pairs count_pairs(Queue& queue, const Engine& engine, const EngineSettings& settings,
                  const ImageGradients* v = nullptr, bool flow = false);

// Tiles of the engine's last image in which v.v_flow is not 0 throughout.
size_t tiles_asking_flow(Queue& queue, const Images& images, const ImageGradients& v);

// Useful operations of a blended pair, an FMA being two: what the formulas of shared/pixel.h need
// when nothing is wasted on lanes that do not count.
double forward_flops(Channels channels);
double backward_flops(Channels channels);

// What a training step touches: Gaussians that Adam moves, of so many parameters each; those that
// are drawn, their tiles, pixels, and bytes of a true colour.
struct Touched {
  double moved = 0, parameters = 0, drawn = 0, intersections = 0, pixels = 0, picture = 3;
};
// Bytes it reads and writes, counted from the kernels' arguments (floats are 4 bytes): Adam's six
// reads and writes of a parameter; a drawn Gaussian's poses, records, sort keys and gradients; an
// intersection's ids, masks, record and 16 sums; a pixel's images and their gradients.
double bytes_of(const Touched& touched);

// Bytes that a stage of `gflow bench raster` reads and writes at least: each argument that a
// Gaussian that is drawn, an intersection or a pixel needs, once (in sorting once a pass). More
// than the copy peak would move in that time is what caches still held. NAN of a name that is no
// stage.
double bytes_of_stage(const std::string& stage, const Touched& touched, Channels channels);

}  // namespace gflow::bench
