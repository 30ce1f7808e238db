// SPDX-License-Identifier: Apache-2.0
// Launches kernels/loss/depth_loss.cl.
#include "optim/loss/depth_loss.hpp"

#include <fmt/format.h>

#include <cmath>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr size_t kItems = 256;      // work-items that sum for the fit
constexpr size_t kSums = 5;         // of each
constexpr int kRounds = 8;          // of the fit: all but the first leave outliers out
constexpr float kLeastPixels = 50;  // in sums of alpha, for two unknowns

}  // namespace

DepthLoss::DepthLoss(Queue& queue, DepthFit kind, float knee, size_t images)
    : kind_(kind),
      knee_(knee),
      lanes_(size_t(queue.lanes)),
      program_(queue, "loss/depth_loss.cl"),
      depth_fit_sums_(program_, "depth_fit_sums"),
      depth_fit_solve_(program_, "depth_fit_solve"),
      depth_loss_(program_, "depth_loss"),
      reduce_(queue) {
  if (!(knee > 0 && std::isfinite(knee)))
    throw Error(fmt::format("depth loss: its knee is {}, it must be above 0", knee));
  std::vector<float> none;
  for (size_t i = 0; i < images; ++i) {
    const float known = kind == DepthFit::none;
    none.insert(none.end(), {1, 0, 1, known});
  }
  fits_.ensure(queue, none.size());
  fits_.write(queue, none);
  partial_.ensure(queue, kSums * kItems);
}

void DepthLoss::fit(Queue& queue, size_t image, size_t n, const Buffer<float>& depth,
                    const Buffer<float>& alpha, const Buffer<float>& file) {
  if (kind_ == DepthFit::none) return;
  for (int round = 0; round < kRounds; ++round) {
    depth_fit_sums_(queue, Range::over(kItems, 1), cl_uint(n), cl_uint(kItems),
                    int(kind_ == DepthFit::disparity), int(round > 0), cl_uint(image), fits_, depth,
                    alpha, file, partial_);
    depth_fit_solve_(queue, Range::over(1, 1), cl_uint(kItems), kLeastPixels, cl_uint(image),
                     partial_, fits_);
  }
}

void DepthLoss::run(Queue& queue, float weight, size_t image, size_t n, const Buffer<float>& depth,
                    const Buffer<float>& alpha, const Buffer<float>& file, Buffer<float>& v_depth,
                    Buffer<float>& v_alpha) {
  for (const Buffer<float>* needed :
       {&depth, &alpha, &file, &std::as_const(v_depth), &std::as_const(v_alpha)})
    if (needed->size() < n)
      throw Error(fmt::format("depth loss of {} pixels: {} has {} values", n, needed->name(),
                              needed->size()));
  terms_.ensure(queue, 3 * n);
  depth_loss_(queue, Range::over((n + lanes_ - 1) / lanes_), cl_uint(n), weight / float(n), knee_,
              int(kind_ == DepthFit::disparity), cl_uint(image), fits_, depth, alpha, file, v_depth,
              v_alpha, terms_);
  pixels_ = n;
}

DepthLossValue DepthLoss::value(Queue& queue) {
  if (pixels_ == 0) throw Error("depth loss: its value was read before its first run");
  DepthLossValue value;
  value.loss = reduce_.sum(queue, terms_, 0, pixels_);
  value.pixels = reduce_.sum(queue, terms_, 2 * pixels_, pixels_);
  if (value.pixels > 0) value.error = reduce_.sum(queue, terms_, pixels_, pixels_) / value.pixels;
  return value;
}

}  // namespace gflow
