// SPDX-License-Identifier: Apache-2.0
// The flow loss: L = weight / (H W) * sum over pixels of s m a rho(|F - F*|), with F the rendered
// flow, F* the teacher's, m its confidence in [0, 1], a the rendered alpha (no gradient through
// it), rho(r) = sqrt(r^2 + knee^2) - knee and s the weight of the pixel's tile: 1, or what
// FlowTiles chose. Pixels without weight give exactly 0.
#pragma once
#include "runtime/primitives/reduce.hpp"

namespace gflow {

struct FlowLossValue {
  double loss = 0;
  double epe = 0;  // mean |F - F*| over confident pixels, by s [px]; 0 when there are none
  double confident_pixels = 0;  // with m > 0 and a usable teacher, counted by s
};

class FlowLoss {
 public:
  // robust_px: the knee, > 0 [px].
  FlowLoss(Queue& queue, float robust_px);

  // v_flow [2, H, W] = dL/d flow, overwritten. flow and teacher [2, H, W] in px, alpha [H, W],
  // confidence [H, W] with 255 = 1. A teacher that is not finite or above 1e5 px has no weight.
  // tile_weights [tiles], 16 x 16 pixels each, row by row; nullptr: all 1.
  void run(Queue& queue, float weight, int width, int height, const Buffer<float>& flow,
           const Buffer<float>& alpha, const Buffer<float>& teacher,
           const Buffer<cl_uchar>& confidence, Buffer<float>& v_flow,
           const Buffer<float>* tile_weights = nullptr);

  // The loss of the last run(); waits for it. Error before the first.
  FlowLossValue value(Queue& queue);

 private:
  float robust_px_;
  size_t lanes_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, In<float>, In<float>, In<float>, In<float>,
         In<cl_uchar>, Out<float>, Out<float>>
      flow_loss_;
  Reduce reduce_;
  size_t pixels_ = 0;
  Buffer<float> terms_;  // [3, H, W] loss; s times end point error, and 1
  Buffer<float> no_weights_{"no tile weights"};
};

// How many pixels of a teacher can have weight; 0 means that the flow pass may be skipped.
// teacher [2, H, W], confidence [H, W].
size_t confident_pixels(const std::vector<float>& teacher, const std::vector<cl_uchar>& confidence);

}  // namespace gflow
