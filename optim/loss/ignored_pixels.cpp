// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/ignored_pixels.hpp"

namespace gflow {

IgnoredPixels::IgnoredPixels(Queue& queue)
    : program_(queue, "loss/ignored.cl"),
      ignored_truth_(program_, "ignored_truth"),
      ignored_gradient_(program_, "ignored_gradient") {}

void IgnoredPixels::fill_truth(Queue& queue, size_t n, const Buffer<cl_uchar>& counted,
                               const Buffer<float>& rgb, Buffer<cl_uchar>& truth) {
  ignored_truth_(queue, Range::over(n), cl_uint(n), counted, rgb, truth);
}

void IgnoredPixels::clear_gradient(Queue& queue, size_t n, const Buffer<cl_uchar>& counted,
                                   Buffer<float>& v_rgb) {
  ignored_gradient_(queue, Range::over(n), cl_uint(n), counted, v_rgb);
}

}  // namespace gflow
