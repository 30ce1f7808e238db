// SPDX-License-Identifier: Apache-2.0
// Launches kernels/loss/image_loss.cl. The borders of the planes are filled only when the size
// changes; the kernels write only inside.
#include "optim/loss/image_loss.hpp"

#include "shared/work.h"

namespace gflow {
namespace {

float checked_weight(float ssim_weight) {
  if (!(ssim_weight >= 0 && ssim_weight <= 1))
    throw Error(
        fmt::format("image loss: the SSIM weight is {}, it must be in [0, 1]", ssim_weight));
  return ssim_weight;
}

}  // namespace

ImageLoss::ImageLoss(Queue& queue, float ssim_weight)
    : ssim_weight_(checked_weight(ssim_weight)),
      lanes_(queue.lanes),
      strip_rows_(LOSS_STRIP(queue.lanes)),
      program_(queue, "common.cl"),
      image_loss_prepare_(program_, "image_loss_prepare"),
      ssim_fwd_(program_, "ssim_fwd"),
      image_loss_bwd_(program_, "image_loss_bwd"),
      l1_bwd_(program_, "l1_bwd"),
      reduce_(queue),
      s_("image loss s"),
      d_("image loss d"),
      by_mean_("SSIM derivative by means"),
      by_ss_("SSIM derivative by mean s^2"),
      by_dd_("SSIM derivative by mean d^2"),
      l1_sum_("sums of L1"),
      ssim_sum_("sums of SSIM") {}

void ImageLoss::resize(Queue& queue, int width, int height) {
  if (width == size_.width && height == size_.height) return;
  const size_t stride = (size_t(width) + 15) / 16 * 16 + 2 * BORDER_X;
  const size_t plane = stride * (size_t(height) + 2 * SSIM_RADIUS);
  if (width < 1 || height < 1 || 3 * plane > size_t(std::numeric_limits<cl_int>::max()))
    throw Error(
        fmt::format("image loss: images of {} x {} pixels; both sides must be at least 1 and the "
                    "area below about 700 million",
                    width, height));
  size_ = {0, 0, 0, 0};  // in case an allocation throws
  d_.ensure(queue, 3 * plane);
  d_.fill(queue, 0);
  s_.ensure(queue, 3 * plane);
  s_.fill(queue, SSIM_OUTSIDE);
  if (ssim_weight_ > 0)
    for (Buffer<float>* map : {&by_mean_, &by_ss_, &by_dd_}) {
      map->ensure(queue, 3 * plane);
      map->fill(queue, 0);
    }
  strips_ =
      size_t(3) * ((width + lanes_ - 1) / lanes_) * ((height + strip_rows_ - 1) / strip_rows_);
  l1_sum_.ensure(queue, strips_);
  ssim_sum_.ensure(queue, strips_);
  size_ = {width, height, int(stride), int(plane)};
}

void ImageLoss::run(Queue& queue, int width, int height, const Buffer<float>& rgb,
                    const Buffer<cl_uchar>& truth, Buffer<float>& v_rgb, float weight) {
  resize(queue, width, height);
  const size_t values = size_t(3) * width * height;
  if (rgb.size() < values || truth.size() < values || v_rgb.size() < values)
    throw Error(
        fmt::format("image loss of {} x {} pixels needs {} values; {} has {}, {} has {},"
                    " {} has {}",
                    width, height, values, rgb.name(), rgb.size(), truth.name(), truth.size(),
                    v_rgb.name(), v_rgb.size()));
  const float l1_scale = float(double(weight) * (1 - double(ssim_weight_)) / double(values));
  const float ssim_scale = float(-double(weight) * double(ssim_weight_) / double(values));
  const Range strips = Range::over(strips_, lanes_ == 1 ? 64 : 1);

  image_loss_prepare_(queue, Range::grid(width, height, 64, 1), size_, rgb, truth, s_, d_);
  if (ssim_weight_ > 0) {
    ssim_fwd_(queue, strips, size_, s_, d_, by_mean_, by_ss_, by_dd_, ssim_sum_);
    image_loss_bwd_(queue, strips, size_, l1_scale, ssim_scale, s_, d_, by_mean_, by_ss_, by_dd_,
                    v_rgb, l1_sum_);
  } else {
    l1_bwd_(queue, strips, size_, l1_scale, d_, v_rgb, l1_sum_);
  }
}

ImageLossValue ImageLoss::value(Queue& queue) {
  if (size_.width == 0) throw Error("image loss: its value was read before its first run");
  const double values = 3.0 * size_.width * size_.height;
  ImageLossValue value;
  value.l1 = reduce_.sum(queue, l1_sum_) / values;
  value.total = (1 - double(ssim_weight_)) * value.l1;
  if (ssim_weight_ > 0) {
    value.ssim = reduce_.sum(queue, ssim_sum_) / values;
    value.total += double(ssim_weight_) * (1 - value.ssim);
  }
  return value;
}

}  // namespace gflow
