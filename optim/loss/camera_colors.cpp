// SPDX-License-Identifier: Apache-2.0
// Launches kernels/loss/camera_color.cl.
#include "optim/loss/camera_colors.hpp"

#include <algorithm>

namespace gflow {
namespace {

// Of the visits of a camera, missed steps do not count: it is seen once in many.
constexpr AdamConfig kAdam{0.9f, 0.999f, false};
constexpr float kEpsilon = 1e-8f;  // gradients of a mean over pixels are about 1e-3

}  // namespace

CameraColors::CameraColors(Queue& queue, size_t cameras, const CameraColorRule& rule)
    : cameras_(cameras),
      rule_(rule),
      program_(queue, "loss/camera_color.cl"),
      camera_color_fwd_(program_, "camera_color_fwd"),
      camera_color_bwd_(program_, "camera_color_bwd"),
      camera_color_grads_(program_, "camera_color_grads"),
      camera_color_center_(program_, "camera_color_center"),
      adam_(queue, kAdam),
      colors_(queue, "camera colours", cameras, CAMERA_COLOR_SIZE),
      rows_(queue, cameras) {
  colors_.values.fill(queue, 0.f);
  colors_.remember(queue);
}

const Buffer<float>& CameraColors::show(Queue& queue, size_t camera, size_t pixels,
                                        const Buffer<float>& rgb) {
  shown_.ensure(queue, 3 * pixels);
  const size_t vectors = (pixels + size_t(queue.lanes) - 1) / size_t(queue.lanes);
  camera_color_fwd_(queue, Range::over(vectors), cl_uint(pixels), cl_uint(camera), colors_.values,
                    rgb, shown_);
  return shown_;
}

void CameraColors::backward(Queue& queue, size_t camera, size_t pixels, const Buffer<float>& rgb,
                            Buffer<float>& v_rgb) {
  constexpr size_t vectors_each = 64;
  const size_t vectors = (pixels + size_t(queue.lanes) - 1) / size_t(queue.lanes);
  const size_t items = std::max<size_t>(1, vectors / vectors_each);
  partial_.ensure(queue, CAMERA_COLOR_SIZE * items);
  camera_color_bwd_(queue, Range::over(items), cl_uint(pixels), cl_uint(items), cl_uint(camera),
                    colors_.values, rgb, v_rgb, partial_);
  camera_color_grads_(queue, Range::over(CAMERA_COLOR_SIZE), cl_uint(items), cl_uint(camera),
                      rule_.shrink, partial_, colors_.values, colors_.grads);
  begin_visit(queue, camera)
      .gradient.copy_range(queue, colors_.grads, camera * CAMERA_COLOR_SIZE, 0, CAMERA_COLOR_SIZE);
}

CameraColors::Visit& CameraColors::begin_visit(Queue& queue, size_t camera) {
  if (visited_ == visits_.size())
    visits_.push_back({0, Buffer<float>(queue, CAMERA_COLOR_SIZE, "gradient of a visit")});
  Visit& visit = visits_[visited_++];
  visit.camera = camera;
  return visit;
}

std::vector<float> CameraColors::take_visit(Queue& queue) {
  return visits_[--visited_].gradient.read(queue);
}

void CameraColors::add_visit(Queue& queue, size_t camera, const std::vector<float>& gradient) {
  begin_visit(queue, camera).gradient.write(queue, gradient);
}

void CameraColors::step(Queue& queue) {
  for (size_t i = 0; i < visited_; ++i) {
    const size_t first = visits_[i].camera * CAMERA_COLOR_SIZE;
    colors_.grads.copy_range(queue, visits_[i].gradient, 0, first, CAMERA_COLOR_SIZE);
    step(queue, visits_[i].camera);
  }
  visited_ = 0;
}

void CameraColors::step(Queue& queue, size_t camera) {
  const RowRange row{camera, 1};
  rows_.seen.fill_range(queue, camera, 1, 1u);
  adam_.refuse(queue, colors_, rows_, row);
  adam_.advance(queue, rows_, row);
  adam_.step(queue, colors_, rows_, row, {rule_.rate, kEpsilon});
  camera_color_center_(queue, Range::over(CAMERA_COLOR_SIZE), cl_uint(cameras_), colors_.values);
}

void CameraColors::save_state(Queue& queue, Arrays& arrays) const {
  const std::vector<size_t> shape{cameras_, CAMERA_COLOR_SIZE};
  arrays["camera_colors/values"] = {shape, colors_.values.read(queue)};
  arrays["camera_colors/exp_avg"] = {shape, colors_.exp_avg.read(queue)};
  arrays["camera_colors/exp_avg_sq"] = {shape, colors_.exp_avg_sq.read(queue)};
  arrays["camera_colors/steps"] = {{cameras_}, rows_.steps.read(queue)};
}

void CameraColors::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  const std::vector<size_t> shape{cameras_, CAMERA_COLOR_SIZE};
  const auto& values = exact_values<float>(arrays, "camera_colors/values", shape, path);
  const auto& mean = exact_values<float>(arrays, "camera_colors/exp_avg", shape, path);
  const auto& square = exact_values<float>(arrays, "camera_colors/exp_avg_sq", shape, path);
  const auto& steps = exact_values<uint32_t>(arrays, "camera_colors/steps", {cameras_}, path);
  visited_ = 0;
  colors_.values.write(queue, values);
  colors_.exp_avg.write(queue, mean);
  colors_.exp_avg_sq.write(queue, square);
  rows_.steps.write(queue, steps);
}

}  // namespace gflow
