// SPDX-License-Identifier: Apache-2.0
// Pixels that take no part in the image loss, such as passers-by under a mask, and pixels that
// matter more than others.
#pragma once
#include "runtime/cl/kernel.hpp"

namespace gflow {

class PixelWeights {
 public:
  explicit PixelWeights(Queue& queue);

  // Before ImageLoss::run: sets truth [n, 3] to the rendered colour, rgb [3, n], where counted [n]
  // is 0.
  void fill_truth(Queue& queue, size_t n, const Buffer<cl_uchar>& counted, const Buffer<float>& rgb,
                  Buffer<cl_uchar>& truth);
  // After it: multiplies the gradient v_rgb [3, n] by `black` where mask [n] is 0, else by `white`.
  // A factor of 0 makes it 0 whatever it was.
  void scale_gradient(Queue& queue, size_t n, const Buffer<cl_uchar>& mask, float black,
                      float white, Buffer<float>& v_rgb);

 private:
  Program program_;
  Kernel<cl_uint, In<cl_uchar>, In<float>, Out<cl_uchar>> ignored_truth_;
  Kernel<cl_uint, cl_float, cl_float, In<cl_uchar>, Out<float>> weighted_gradient_;
};

}  // namespace gflow
