// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/camera_objective.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "optim/scene/camera_correction.hpp"
#include "optim/scene/depths.hpp"
#include "optim/scene/move_cameras.hpp"

namespace gflow {
namespace {

std::vector<double> depths_of(const Scene& scene) {
  std::vector<double> depths(scene.cameras.size());
  for (const Frame& frame : scene.train) {
    double& depth = depths[size_t(frame.camera)];
    if (depth == 0) depth = depth_of_scene(scene, frame.camera);
  }
  return depths;
}

double between_rates(double first, double last, double share) {
  return first > 0 ? first * std::pow(last / first, share) : 0;
}

}  // namespace

bool refines_cameras(const CameraOptions& options, const Scene& scene) {
  return options.refine == RefineCameras::on ||
         (options.refine == RefineCameras::automatic && scene.estimated_cameras);
}

CameraObjective::CameraObjective(Queue& queue, const TrainOptions& options, const Scene& scene,
                                 FrameStore& frames, const std::vector<FlowPair>& pairs)
    : options_(options),
      scene_(scene),
      frames_(frames),
      pairs_(pairs),
      gradients_(queue),
      depths_(depths_of(scene)),
      start_focal_(frames.moved_cameras()[0].fx / scene.cameras[0].fx),
      poses_(scene.cameras.size(), kPose),
      focal_(1, 1) {
  for (const Camera& camera : frames.cameras()) start_.push_back(camera.viewmat);
}

void CameraObjective::add_pose_gradients(Queue& queue, const ViewContext& view,
                                         const Renderer& renderer, GaussianGradients& gradients) {
  const Shot& shot = renderer.shot();
  gradients_.start(queue, shot.view, shot.flow, renderer.engine().splats(), renderer.gaussians(),
                   renderer.gaussians_t2(), gradients);
  const Frame& frame = *view.sample.frame;
  seen_.push_back(size_t(frame.camera));
  if (!shot.flow) return;
  const int next = pairs_[size_t(view.sample.pair)].next;
  seen_.push_back(size_t(next >= 0 ? scene_.train[size_t(next)].camera : frame.camera));
}

// Adam, whose bias corrections count the row's own steps: a camera is seen once in many steps.
void CameraObjective::Rows::step(size_t row, const std::vector<double>& gradient, double rate) {
  constexpr double beta1 = 0.9, beta2 = 0.99, epsilon = 1e-12;
  const double n = double(++steps[row]);
  for (size_t k = 0; k < size; ++k) {
    const size_t at = row * size + k;
    mean[at] = float(beta1 * double(mean[at]) + (1 - beta1) * gradient[k]);
    square[at] = float(beta2 * double(square[at]) + (1 - beta2) * gradient[k] * gradient[k]);
    const double m = double(mean[at]) / (1 - std::pow(beta1, n));
    const double s = double(square[at]) / (1 - std::pow(beta2, n));
    values[at] = float(double(values[at]) - rate * m / (std::sqrt(s) + epsilon));
  }
}

void CameraObjective::end_step(Queue& queue, const StepContext& context) {
  const std::vector<CameraSums> sums = gradients_.take(queue);
  const double share = double(context.step) / std::max(1, options_.train.iterations - 1);
  if (share < double(options_.cameras.start)) return seen_.clear();
  const double pull = double(options_.cameras.pull);
  std::map<size_t, std::vector<double>> poses;
  double focal = pull * double(focal_.values[0]);
  for (size_t i = 0; i < sums.size(); ++i) {
    const CameraSums& g = sums[i];
    if (!std::all_of(g.begin(), g.end(), [](double x) { return std::isfinite(x); })) continue;
    const size_t camera = seen_[i];
    const double depth = depths_[camera];
    auto [entry, is_new] = poses.try_emplace(camera, kPose);
    std::vector<double>& pose = entry->second;
    if (is_new)
      for (size_t k = 0; k < kPose; ++k) pose[k] = pull * double(poses_.values[camera * kPose + k]);
    // About the axis point (0, 0, depth) instead of the camera's centre (CameraCorrection).
    pose[0] += g[0] + depth * g[4];
    pose[1] += g[1] - depth * g[3];
    pose[2] += g[2];
    for (size_t k = 0; k < 3; ++k) pose[3 + k] += depth * g[3 + k];
    focal += g[6] + g[7];
  }
  seen_.clear();
  const double rate = between_rates(double(options_.lr.cameras), double(options_.lr.cameras_final),
                                    std::min(1., share));
  for (const auto& [camera, gradient] : poses) poses_.step(camera, gradient, rate);
  if (!poses.empty()) focal_.step(0, {focal}, rate);
  apply();
}

Eigen::Matrix4d CameraObjective::corrected(size_t camera) const {
  Eigen::Matrix<double, 6, 1> x;
  for (size_t k = 0; k < kPose; ++k) x[long(k)] = double(poses_.values[camera * kPose + k]);
  return CameraCorrection::of(x).applied(start_[camera], depths_[camera]);
}

void CameraObjective::apply() {
  std::map<size_t, Eigen::Matrix4d> poses;
  for (size_t i = 0; i < depths_.size(); ++i)
    if (depths_[i] > 0) poses[i] = corrected(i);
  move_cameras(scene_, poses, start_focal_ * std::exp(double(focal_.values[0])), frames_);
}

void CameraObjective::report(Queue&, const Renderer&, LossReport& report) {
  double turns = 0, shifts = 0;
  size_t count = 0;
  for (size_t i = 0; i < depths_.size(); ++i) {
    if (depths_[i] == 0) continue;
    ++count;
    for (size_t k = 0; k < kPose; ++k) {
      const double x = double(poses_.values[i * kPose + k]);
      (k < 3 ? turns : shifts) += x * x;
    }
  }
  report.terms.push_back({"camera_turn", std::sqrt(turns / double(count)) / degree, ""});
  report.terms.push_back({"camera_shift", 100 * std::sqrt(shifts / double(count)), ""});
}

void CameraObjective::save(const char* name, const Rows& rows, Arrays& arrays) const {
  const std::string prefix = std::string("cameras/") + name + "/";
  const std::vector<size_t> shape{rows.steps.size(), rows.size};
  arrays[prefix + "values"] = {shape, rows.values};
  arrays[prefix + "exp_avg"] = {shape, rows.mean};
  arrays[prefix + "exp_avg_sq"] = {shape, rows.square};
  arrays[prefix + "steps"] = {{rows.steps.size()}, rows.steps};
}

void CameraObjective::load(const char* name, Rows& rows, const Arrays& arrays,
                           const std::string& path) {
  const std::string prefix = std::string("cameras/") + name + "/";
  const std::vector<size_t> shape{rows.steps.size(), rows.size};
  rows.values = exact_values<float>(arrays, prefix + "values", shape, path);
  rows.mean = exact_values<float>(arrays, prefix + "exp_avg", shape, path);
  rows.square = exact_values<float>(arrays, prefix + "exp_avg_sq", shape, path);
  rows.steps = exact_values<uint32_t>(arrays, prefix + "steps", {rows.steps.size()}, path);
}

void CameraObjective::save_state(Queue&, Arrays& arrays) {
  std::vector<double> start;
  for (const Eigen::Matrix4d& pose : start_)
    start.insert(start.end(), pose.data(), pose.data() + 16);
  arrays["cameras/start"] = {{start_.size(), 16}, start};
  arrays["cameras/start_focal"] = {{1}, std::vector<double>{start_focal_}};
  save("poses", poses_, arrays);
  save("focal", focal_, arrays);
}

void CameraObjective::load_state(Queue&, const Arrays& arrays, const std::string& path) {
  const auto& start = exact_values<double>(arrays, "cameras/start", {start_.size(), 16}, path);
  bool moves = focal_.steps[0] > 0;
  for (size_t i = 0; i < start_.size(); ++i) {
    const Eigen::Matrix4d pose(&start[16 * i]);
    moves = moves || pose != start_[i];
    start_[i] = pose;
  }
  start_focal_ = exact_values<double>(arrays, "cameras/start_focal", {1}, path)[0];
  load("poses", poses_, arrays, path);
  load("focal", focal_, arrays, path);
  // Before the first correction the cameras keep their bits.
  if (moves || focal_.steps[0] > 0) apply();
}

}  // namespace gflow
