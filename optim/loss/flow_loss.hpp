// SPDX-License-Identifier: Apache-2.0
// The flow loss: L = weight / (H W) * sum over pixels of s m a rho(|F - F*|), with F the rendered
// flow, F* the target flow, m its confidence in [0, 1], a the rendered alpha (no gradient through
// it), rho(r) = sqrt(r^2 + knee^2) - knee, and s the weight of the pixel's tile: 1, or as chosen by
// FlowTiles. Pixels without weight contribute exactly 0.
#pragma once
#include "runtime/primitives/reduce.hpp"

namespace gflow {

struct FlowLossValue {
  double loss = 0;
  double epe = 0;  // mean |F - F*| over confident pixels, weighted by s [px]; 0 if there are none
  double confident_pixels = 0;  // pixels with m > 0 and a usable target, weighted by s
};

class FlowLoss {
 public:
  // robust_px: the knee, > 0 [px].
  FlowLoss(Queue& queue, float robust_px);

  // Sets v_flow [2, H, W] = dL/d flow. flow and target flow, the target flow, [2, H, W] [px]; alpha
  // [H, W]; confidence [H, W] with 255 = 1. Target flow that is non-finite or above 1e5 px has no
  // weight. tile_weights [tiles] of 16 x 16 pixels, row by row; nullptr: all 1.
  void run(Queue& queue, float weight, int width, int height, const Buffer<float>& flow,
           const Buffer<float>& alpha, const Buffer<float>& target_flow,
           const Buffer<cl_uchar>& confidence, Buffer<float>& v_flow,
           const Buffer<float>* tile_weights = nullptr);

  // The loss of the last run(). Waits. Error before the first.
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
  Buffer<float> terms_;  // [3, H, W]: loss; s times end-point error; s, where confident
  Buffer<float> no_weights_{"no tile weights"};
};

// Number of pixels of a target flow that can have weight; at 0 the flow pass may be skipped.
// target flow [2, H, W], confidence [H, W].
size_t confident_pixels(const std::vector<float>& target_flow,
                        const std::vector<cl_uchar>& confidence);

}  // namespace gflow
