// SPDX-License-Identifier: Apache-2.0
// Subsampling of the flow loss by tiles of 16 x 16 pixels. Tiles whose target flow is long are
// evaluated in every step, low-motion tiles in a share of the steps with weight 1 / share. All
// tiles of an image share one random number. The gradient is unbiased, at the cost of the evaluated
// tiles only. Nonlinear functions of the gradient are biased: in low-motion tiles its mean norm
// (adc, waking of static Gaussians) and mean square (Adam) are larger. Effect on quality:
// optim/loss/README.md.
#pragma once
#include "runtime/cl/kernel.hpp"

namespace gflow {

struct LowMotionRule {
  float share = 1;  // least probability of a tile, in (0, 1]; 1: all tiles in every step
  // Tiles with at least this motion are always evaluated [px]; > 0. Below, the probability is
  // proportional to the motion.
  float px = 0.5f;
};

class FlowTiles {
 public:
  // Error if the rule is out of range.
  FlowTiles(Queue& queue, const LowMotionRule& rule);

  // Weights [tiles], row by row, of an image of width x height: 0, or 1 / probability. Tiles in
  // which no pixel has confidence get 0. target_flow: [2, H, W] [px]; confidence: [H, W] with
  // 255 = 1. The same seed gives the same choice.
  const Buffer<float>& choose(Queue& queue, uint32_t seed, int width, int height,
                              const Buffer<float>& target_flow, const Buffer<cl_uchar>& confidence);

 private:
  LowMotionRule rule_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_float, In<float>, In<cl_uchar>, Out<float>>
      flow_tiles_;
  Buffer<float> weights_{"tile weights"};
};

}  // namespace gflow
