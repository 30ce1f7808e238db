// SPDX-License-Identifier: Apache-2.0
#include "apps/python/shown_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "apps/python/rasterization.hpp"
#include "optim/model/slice.hpp"
#include "optim/runs/run_state.hpp"
#include "optim/scene/cameras_json.hpp"

namespace gflow::python {
namespace {

// L = R diag(s) column by column where the columns are orthogonal, as in all models with a rotation
// of their own: axes then keep their order over time, as material transport needs. Else by SVD.
FactorParts parts_in_order(const float* factor) {
  using Matrix = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  Eigen::Matrix3d l = Eigen::Map<const Matrix>(factor).cast<double>();
  const Eigen::Vector3d s = l.colwise().norm();
  if (!(s.minCoeff() > 0)) return parts_of_factor(factor);
  for (int k = 0; k < 3; ++k) l.col(k) /= s(k);
  constexpr double kRounding = 1e-4;  // of columns in float
  if ((l.transpose() * l - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > kRounding)
    return parts_of_factor(factor);
  if (l.determinant() < 0) l.col(2) = -l.col(2);
  const Eigen::Quaterniond q = Eigen::Quaterniond(l).normalized();
  return {{s(0), s(1), s(2)}, {q.w(), q.x(), q.y(), q.z()}};
}

// The near plane that a run has written; 0 if there is none.
float near_of(const std::string& cameras) {
  if (!std::filesystem::exists(cameras)) return 0;
  const std::vector<Camera> all = read_cameras_json(cameras, 1);
  return all.empty() ? 0 : float(all[0].near);
}

void require_time(double time, const char* name) {
  if (!(time >= 0 && time <= 1))
    throw InputError(fmt::format("a model's time '{}' is {}, expected 0 to 1", name, time));
}

}  // namespace

ShownModel::ShownModel(HostModel host, TrainOptions config, float near)
    : host_(std::move(host)), settings_(engine_settings(config)), near_(near > 0 ? near : 0.05f) {}

ShownModel ShownModel::load(const std::string& path, int iteration) {
  if (!std::filesystem::exists(path))
    throw Error(fmt::format("cannot read {}: there is no such run folder or splat file", path));
  if (!std::filesystem::is_directory(path)) {
    if (iteration != latest_iteration)
      throw InputError(
          fmt::format("iteration {} is that of a run folder, but {} is not one", iteration, path));
    return ShownModel(read_model(path), TrainOptions(), 0);
  }
  const RunFolder run = RunFolder::open(path);
  RunState state = read_run_state(run, iteration);
  const float near = near_of(run.path("cameras.json"));
  ShownModel model(std::move(state.model), state.config, near);
  model.state_ = state.text();
  return model;
}

ShownModel::~ShownModel() {
  if (!device_) return;
  const std::lock_guard<std::mutex> lock(device_->mutex);
  renderer_.reset();
  model_.reset();
}

Model& ShownModel::on(Device& device) {
  if (device_ != &device) {
    renderer_ = std::make_unique<Renderer>(device.queue, settings_);
    model_ = std::make_unique<Model>(device.queue, host_, Purpose::rendering);
    device_ = &device;
  }
  return *model_;
}

Poses ShownModel::at(double time) {
  require_time(time, "t");
  Device& device = current_device();
  std::vector<float> factors;
  Poses poses;
  if (host_.count > 0) {
    const std::lock_guard<std::mutex> lock(device.mutex);
    Queue& queue = device.queue;
    Model& model = on(device);
    GaussiansAt shown, posed;
    model.motion->at(queue, model.parameters, model.time(time), nullptr, shown);
    poses.opacities = shown.opacities.read(queue);
    Buffer<cl_uint> all(queue, host_.count, "all rows");
    all.fill(queue, 1);
    posed.ensure(queue, host_.count);
    model.motion->at(queue, model.parameters, model.time(time), &all, posed);
    poses.means = posed.means.read(queue);
    factors = posed.factors.read(queue);
  }
  poses.quats.resize(4 * host_.count);
  poses.scales.resize(3 * host_.count);
  for (size_t i = 0; i < host_.count; ++i) {
    const FactorParts parts = parts_in_order(&factors[9 * i]);
    std::copy(parts.quat.begin(), parts.quat.end(), &poses.quats[4 * i]);
    std::copy(parts.scales.begin(), parts.scales.end(), &poses.scales[3 * i]);
  }
  return poses;
}

Pictures ShownModel::render(const Camera& camera, double time, std::optional<double> time_t2,
                            const Camera& camera_t2, const std::array<float, 3>& background,
                            std::optional<float> near) {
  require_time(time, "t");
  if (time_t2) require_time(*time_t2, "t2");
  if (camera_t2.width != camera.width || camera_t2.height != camera.height)
    throw InputError(fmt::format("the camera at t2 has {} x {} pixels, the one at t {} x {}",
                                 camera_t2.width, camera_t2.height, camera.width, camera.height));
  if (near && !(*near >= 0))
    throw InputError(fmt::format("a near plane is at {}, expected at least 0", *near));
  for (const float level : background)
    if (!std::isfinite(level))
      throw InputError(fmt::format("a background has the colour {}", level));
  Device& device = current_device();
  const std::lock_guard<std::mutex> lock(device.mutex);
  Queue& queue = device.queue;
  Model& model = on(device);
  Shot shot;
  shot.view.camera = pinhole(camera, near.value_or(near_));
  shot.view.camera_t2 = pinhole(camera_t2, near.value_or(near_));
  shot.time = time;
  shot.time_t2 = time_t2.value_or(time);
  shot.flow = time_t2.has_value();
  shot.depth = true;
  shot.background = background;
  renderer_->forward(queue, model, shot);
  const Images& images = renderer_->images();
  const size_t pixels = size_t(camera.width) * size_t(camera.height);
  const std::vector<float> rgb = images.rgb.read(queue);
  Pictures pictures;
  pictures.colors.resize(3 * pixels);
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < 3; ++c) pictures.colors[3 * i + c] = rgb[c * pixels + i];
  pictures.alphas = images.alpha.read(queue);
  pictures.depth = images.depth.read(queue);
  for (size_t i = 0; i < pixels; ++i)
    pictures.depth[i] /= std::max(pictures.alphas[i], kLeastAlpha);
  if (!shot.flow) return pictures;
  const std::vector<float> flow = images.flow.read(queue);
  pictures.flow.resize(2 * pixels);
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < 2; ++c) pictures.flow[2 * i + c] = flow[c * pixels + i];
  return pictures;
}

}  // namespace gflow::python
