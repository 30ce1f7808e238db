// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/pixel_weights.hpp"

namespace gflow {

PixelWeights::PixelWeights(Queue& queue)
    : program_(queue, "loss/pixel_weights.cl"),
      ignored_truth_(program_, "ignored_truth"),
      weighted_gradient_(program_, "weighted_gradient") {}

void PixelWeights::fill_truth(Queue& queue, size_t n, const Buffer<cl_uchar>& counted,
                              const Buffer<float>& rgb, Buffer<cl_uchar>& truth) {
  ignored_truth_(queue, Range::over(n), cl_uint(n), counted, rgb, truth);
}

void PixelWeights::scale_gradient(Queue& queue, size_t n, const Buffer<cl_uchar>& mask, float black,
                                  float white, Buffer<float>& v_rgb) {
  weighted_gradient_(queue, Range::over(n), cl_uint(n), black, white, mask, v_rgb);
}

}  // namespace gflow
