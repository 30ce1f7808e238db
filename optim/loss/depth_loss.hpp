// SPDX-License-Identifier: Apache-2.0
// The depth loss: L = weight / (H W) * sum over pixels of a rho(log(z / z*)), with z the mean depth
// of what is rendered, a its alpha (no gradient through this factor), z* the depth of a file and
// rho(r) = sqrt(r^2 + knee^2) - knee, which errors of the file hardly move. Files that know depth
// or inverse depth up to a scale and a shift of each image are fitted to the rendered depth, by
// least squares with the weights of Cauchy's distribution.
#pragma once
#include "runtime/primitives/reduce.hpp"

namespace gflow {

// What scale and shift are fitted to: nothing, the depth, or the inverse depth.
enum class DepthFit { none, depth, disparity };

struct DepthLossValue {
  double loss = 0;
  double error = 0;   // mean |log(z / z*)| over the pixels that count; 0 if there are none
  double pixels = 0;  // that count: something is drawn and the file has a depth
};

class DepthLoss {
 public:
  // knee: relative error of the depth from which the loss grows linearly, > 0. images: number of
  // files.
  DepthLoss(Queue& queue, DepthFit kind, float knee, size_t images);

  // Fits scale and shift of an image's file to its rendered depth [n]; with DepthFit::none it has
  // none. Where the view says nothing about them, the image has no fit. Arguments as for run(). The
  // median of the values of the file must be near 0 and their median deviation near 1.
  void fit(Queue& queue, size_t image, size_t n, const Buffer<float>& depth,
           const Buffer<float>& alpha, const Buffer<float>& file);

  // Adds dL / d depth and dL / d alpha to v_depth, v_alpha [n]; nothing if the image has no fit
  // yet. depth [n]: sum of weight x depth, alpha [n] as the engine renders them; file [n]: the
  // file's values, NaN where it has none. They may be a part of the image.
  void run(Queue& queue, float weight, size_t image, size_t n, const Buffer<float>& depth,
           const Buffer<float>& alpha, const Buffer<float>& file, Buffer<float>& v_depth,
           Buffer<float>& v_alpha);

  // The loss of the last run(). Waits. Error before the first.
  DepthLossValue value(Queue& queue);

  // [images, 4]: scale, shift, mean of the fitted values, and 1, or 0 if there is no fit; for
  // checkpoints.
  Buffer<float>& fits() { return fits_; }

 private:
  DepthFit kind_;
  float knee_;
  size_t lanes_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_int, cl_int, cl_uint, In<float>, In<float>, In<float>, In<float>,
         Out<float>>
      depth_fit_sums_;
  Kernel<cl_uint, cl_float, cl_uint, In<float>, Out<float>> depth_fit_solve_;
  Kernel<cl_uint, cl_float, cl_float, cl_int, cl_uint, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>, Out<float>>
      depth_loss_;
  Reduce reduce_;
  size_t pixels_ = 0;
  Buffer<float> fits_{"depth fits"}, partial_{"sums of the depth fit"}, terms_{"depth loss terms"};
};

}  // namespace gflow
