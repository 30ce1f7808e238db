// SPDX-License-Identifier: Apache-2.0
// Pixels that take no part in the image loss, such as passers-by under a mask.
#pragma once
#include "runtime/cl/kernel.hpp"

namespace gflow {

class IgnoredPixels {
 public:
  explicit IgnoredPixels(Queue& queue);

  // Before ImageLoss::run: sets truth [n, 3] to the rendered colour, rgb [3, n], where counted [n]
  // is 0.
  void fill_truth(Queue& queue, size_t n, const Buffer<cl_uchar>& counted, const Buffer<float>& rgb,
                  Buffer<cl_uchar>& truth);
  // After it: sets the gradient of these pixels to 0.
  void clear_gradient(Queue& queue, size_t n, const Buffer<cl_uchar>& counted,
                      Buffer<float>& v_rgb);

 private:
  Program program_;
  Kernel<cl_uint, In<cl_uchar>, In<float>, Out<cl_uchar>> ignored_truth_;
  Kernel<cl_uint, In<cl_uchar>, Out<float>> ignored_gradient_;
};

}  // namespace gflow
