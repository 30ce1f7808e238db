// SPDX-License-Identifier: Apache-2.0
// Counts of the work done for an image.
#pragma once
#include "optim/engine/engine.hpp"

namespace gflow::bench {

// Pairs of a pixel and a splat. listed: in the tile lists, whole. masked: in cells of the masks, up
// to where skip.saturated stops. blended: contributing. back: in the backward pass, in cells of the
// masks with nonzero gradients.
struct Pairs {
  double listed = 0, masked = 0, blended = 0, back = 0;
};

// Counts for the engine's last image. `settings` are those it was rendered with, v (nullptr: all
// nonzero) the image gradients, including v_flow if `flow`.
Pairs count_pairs(Queue& queue, const Engine& engine, const EngineSettings& settings,
                  const ImageGradients* v = nullptr, bool flow = false);

// Number of tiles of the engine's last image with a nonzero v.v_flow.
size_t tiles_asking_flow(Queue& queue, const Images& images, const ImageGradients& v);

// Useful operations per blended pair, with an FMA counted as two: what the formulas of
// shared/pixel.h need, without lanes that do not contribute.
double forward_flops(Channels channels);
double backward_flops(Channels channels);

// What a training step touches: Gaussians that Adam updates and their parameters each; drawn
// Gaussians, tile intersections, pixels, and bytes per pixel of a ground-truth image.
struct Touched {
  double moved = 0, parameters = 0, drawn = 0, intersections = 0, pixels = 0, truth_bytes = 3;
};
// Bytes read and written, counted from the kernels' arguments (4 bytes per float): Adam's six
// accesses per parameter; poses, records, sort keys and gradients per drawn Gaussian; ids, masks,
// record and 16 sums per intersection; images and their gradients per pixel.
double bytes_of(const Touched& touched);

// Minimum bytes that a stage of `gflow bench raster` reads and writes: each argument per drawn
// Gaussian, intersection or pixel, once (in sorting once per pass). A rate above the copy peak
// means cache hits. NAN for an unknown stage.
double bytes_of_stage(const std::string& stage, const Touched& touched, Channels channels);

}  // namespace gflow::bench
