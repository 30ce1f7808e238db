// SPDX-License-Identifier: Apache-2.0
// The image loss of 3DGS: L = (1 - l) mean |x - y| + l (1 - mean SSIM(x, y)), means over pixels and
// channels. Value and gradient stay on the device; only value() reads back and waits.
#pragma once
#include <limits>

#include "runtime/primitives/reduce.hpp"
#include "shared/loss.h"

GFLOW_KERNEL_STRUCT(ImageLossSize);

namespace gflow {

struct ImageLossValue {
  double l1 = 0;                                           // mean |x - y|
  double ssim = std::numeric_limits<double>::quiet_NaN();  // mean SSIM; NaN if its weight is 0
  double total = 0;                                        // L
};

class ImageLoss {
 public:
  // ssim_weight: l, in [0, 1]; at 0 SSIM is not computed.
  ImageLoss(Queue& queue, float ssim_weight);

  // Sets v_rgb [3, H, W] = dL/d rgb. rgb [3, H, W] in [0, 1]; truth [H, W, 3], 255 = 1. Where rgb
  // equals truth, |x - y| has derivative 0. The size may change from call to call. weight
  // multiplies the gradient, not value(): the share of the image if only a part of it is given.
  void run(Queue& queue, int width, int height, const Buffer<float>& rgb,
           const Buffer<cl_uchar>& truth, Buffer<float>& v_rgb, float weight = 1);

  // The loss of the last run(). Waits. Error before the first.
  ImageLossValue value(Queue& queue);

 private:
  void resize(Queue& queue, int width, int height);

  float ssim_weight_;
  int lanes_, strip_rows_;
  Program program_;
  Kernel<ImageLossSize, In<float>, In<cl_uchar>, Out<float>, Out<float>> image_loss_prepare_;
  Kernel<ImageLossSize, In<float>, In<float>, Out<float>, Out<float>, Out<float>, Out<float>>
      ssim_fwd_;
  Kernel<ImageLossSize, cl_float, cl_float, In<float>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>>
      image_loss_bwd_;
  Kernel<ImageLossSize, cl_float, In<float>, Out<float>, Out<float>> l1_bwd_;
  Reduce reduce_;

  ImageLossSize size_ = {0, 0, 0, 0};
  size_t strips_ = 0;
  Buffer<float> s_, d_, by_mean_, by_ss_, by_dd_;  // [3, plane], see shared/loss.h
  Buffer<float> l1_sum_, ssim_sum_;                // [strips]
};

}  // namespace gflow
