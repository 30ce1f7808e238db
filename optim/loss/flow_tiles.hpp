// SPDX-License-Identifier: Apache-2.0
// Flow where a scene needs it: tiles of 16 x 16 pixels in which the teacher moves are asked of in
// every step, calm ones in a share of the steps, 1 / share times as much, those of a picture in the
// same steps. An estimate of the gradient of all tiles that is right in the mean, and costs what is
// asked alone. What is not linear in the gradient is not right in the mean: in calm tiles its mean
// length (density control by adc, waking of those at rest) and square (Adam) are larger. What that
// costs: optim/loss/README.md.
#pragma once
#include "runtime/cl/kernel.hpp"

namespace gflow {

struct LowMotionRule {
  float share = 1;  // least probability that a tile counts, in (0, 1]; 1: all tiles always count
  float px = 0.5f;  // motion from which one always counts, above 0 [px]; below in proportion
};

class FlowTiles {
 public:
  // Error when the rule is out of its ranges.
  FlowTiles(Queue& queue, const LowMotionRule& rule);

  // Weights [tiles], row by row, of a picture of width x height: 0, or 1 / share. A tile without a
  // pixel of any confidence has 0. teacher [2, H, W] px, confidence [H, W] with 255 = 1. The same
  // seed gives the same choice.
  const Buffer<float>& choose(Queue& queue, uint32_t seed, int width, int height,
                              const Buffer<float>& teacher, const Buffer<cl_uchar>& confidence);

 private:
  LowMotionRule rule_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_float, In<float>, In<cl_uchar>, Out<float>>
      flow_tiles_;
  Buffer<float> weights_{"tile weights"};
};

}  // namespace gflow
