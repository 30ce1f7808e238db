// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/baked_poses.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "optim/model/slice.hpp"
#include "shared/motion/life.h"

namespace gflow {
namespace {

Eigen::Matrix3d rotation_of(const std::array<double, 4>& q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

std::array<double, 4> quat_of(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  return {q.w(), q.x(), q.y(), q.z()};
}

// The columns as axes. False if they are not orthogonal, or one has no direction.
bool axes_of_columns(const Eigen::Matrix3d& l, FactorPose& pose) {
  constexpr double kOrthogonal = 1e-3;  // of float columns; a factor without scales is far from it
  Eigen::Matrix3d axes = l;
  for (long k = 0; k < 3; ++k) {
    pose.scales[size_t(k)] = l.col(k).norm();
    if (!(pose.scales[size_t(k)] > 1e-30)) return false;
    axes.col(k) /= pose.scales[size_t(k)];
  }
  const Eigen::Matrix3d products = axes.transpose() * axes;
  if (!((products - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kOrthogonal)) return false;
  if (axes.determinant() < 0) axes.col(2) = -axes.col(2);
  pose.quat = quat_of(axes);
  return true;
}

// Reorders axes, given in any order, so that each is nearest to its own of the time before.
void follow_axes(FactorPose& pose, const FactorPose& before) {
  const Eigen::Matrix3d axes = rotation_of(pose.quat);
  const Eigen::Matrix3d products = rotation_of(before.quat).transpose() * axes;
  std::array<long, 3> order = {0, 1, 2}, best = order;
  double most = -1;
  do {
    double sum = 0;
    for (long k = 0; k < 3; ++k) sum += std::fabs(products(k, order[size_t(k)]));
    if (sum > most + 1e-9) most = sum, best = order;
  } while (std::next_permutation(order.begin(), order.end()));
  Eigen::Matrix3d sorted;
  const std::array<double, 3> scales = pose.scales;
  for (size_t k = 0; k < 3; ++k) {
    const bool turned = products(long(k), best[k]) < 0;
    sorted.col(long(k)) = (turned ? -1 : 1) * axes.col(best[k]);
    pose.scales[k] = scales[size_t(best[k])];
  }
  if (sorted.determinant() < 0) {  // turn the axis that follows its own least
    long least = 0;
    for (long k = 1; k < 3; ++k)
      if (std::fabs(products(k, best[size_t(k)])) < std::fabs(products(least, best[size_t(least)])))
        least = k;
    sorted.col(least) = -sorted.col(least);
  }
  pose.quat = quat_of(sorted);
}

// Opacities by kernels/shared/motion/life.h, 0 outside the time window.
float opacity_by_life(const HostGroups& groups, size_t i, float t, float sigmas) {
  const float dt = t - groups.at("means_t")[i];
  const float life = std::exp(groups.at("log_scales")[4 * i + 3]);
  if (!is_in_time_window(dt, life, sigmas)) return 0;
  return float(life_at(groups.at("logit_opacities")[i], dt, double(life) * life).opacity);
}

// Distance of row `at` of [times, rows, width] from between the rows at `from` and `to`.
double off_the_line(const std::vector<float>& values, size_t width, size_t from, size_t at,
                    size_t to, double share, bool unit) {
  double line[4], norm = 0, squares = 0;
  for (size_t c = 0; c < width; ++c) {
    line[c] = (1 - share) * double(values[from + c]) + share * double(values[to + c]);
    norm += line[c] * line[c];
  }
  norm = unit ? std::sqrt(norm) : 1;
  for (size_t c = 0; c < width; ++c)
    squares += std::pow(line[c] / norm - double(values[at + c]), 2);
  return std::sqrt(squares);
}

// Errors of the poses that every k-th time leaves out: per time left out, of M poses and N
// opacities (if there are any).
std::vector<float> errors_of_stride(const BakedPoses& poses, const std::vector<double>& sizes,
                                    size_t stride) {
  const size_t steps = poses.times.size(), m = poses.moving,
               n = poses.opacities.size() / std::max<size_t>(steps, 1);
  std::vector<float> errors;
  for (size_t k = 0; k < steps; ++k) {
    const size_t from = k / stride * stride, to = std::min(from + stride, steps - 1);
    if (k == from || k == to) continue;
    const double share =
        (poses.times[k] - poses.times[from]) / (poses.times[to] - poses.times[from]);
    const auto off = [&](const std::vector<float>& values, size_t rows, size_t width, size_t i,
                         bool unit = false) {
      if (values.empty()) return 0.0;
      const auto at = [&](size_t step) { return (step * rows + i) * width; };
      return off_the_line(values, width, at(from), at(k), at(to), share, unit);
    };
    for (size_t i = 0; i < m; ++i)
      errors.push_back(
          float(std::max({off(poses.means, m, 3, i) / sizes[i], 2 * off(poses.quats, m, 4, i, true),
                          off(poses.log_scales, m, 3, i)})));
    for (size_t i = 0; i < n; ++i) errors.push_back(float(off(poses.opacities, n, 1, i)));
  }
  return errors;
}

}  // namespace

bool needs_poses(const HostModel& model) {
  const MotionModelKind kind = model.shape.motion;
  return kind != MotionModelKind::spacetime && kind != MotionModelKind::native4d &&
         kind != MotionModelKind::keyframes && !is_static_model(model);
}

std::vector<double> times_within(const std::vector<double>& times, size_t moving, size_t most) {
  constexpr size_t kPoseBytes = 40;
  const size_t count = std::max<size_t>(most / (kPoseBytes * std::max<size_t>(moving, 1)), 2);
  if (times.size() <= count) return times;
  std::vector<double> chosen;
  for (size_t k = 0; k < count; ++k) chosen.push_back(times[k * (times.size() - 1) / (count - 1)]);
  return chosen;
}

BakedPoses thinned(const BakedPoses& poses, const HostModel& model, double tolerance) {
  const size_t steps = poses.times.size();
  std::vector<double> sizes;
  for (size_t i = 0; i < poses.moving; ++i)
    sizes.push_back(std::max(longest_scale(model, i), 1e-30));
  if (steps < 3 || sizes.empty()) return poses;
  // Those that all strides give back are most of a scene; they must not outvote the others.
  const size_t rows = poses.moving + poses.opacities.size() / steps;
  std::vector<bool> bends(rows, false);
  const std::vector<float> straight = errors_of_stride(poses, sizes, steps - 1);
  for (size_t i = 0; i < straight.size(); ++i)
    if (!(double(straight[i]) <= tolerance)) bends[i % rows] = true;
  size_t stride = 1;
  for (size_t next = 2; next < steps; ++next) {
    const std::vector<float> all = errors_of_stride(poses, sizes, next);
    std::vector<float> errors{0};
    for (size_t i = 0; i < all.size(); ++i)
      if (bends[i % rows]) errors.push_back(all[i]);
    const auto worst = errors.begin() + long(0.95 * double(errors.size() - 1));
    std::nth_element(errors.begin(), worst, errors.end());
    if (!(double(*worst) <= tolerance)) break;
    stride = next;
  }
  BakedPoses left;
  left.moving = poses.moving;
  for (size_t k = 0; k < steps; k = k + 1 == steps ? steps : std::min(k + stride, steps - 1)) {
    left.times.push_back(poses.times[k]);
    const auto keep = [&](std::vector<float> BakedPoses::*member) {
      const std::vector<float>& all = poses.*member;
      const size_t row = all.size() / steps;
      const auto first = all.begin() + long(k * row);
      (left.*member).insert((left.*member).end(), first, first + long(row));
    };
    keep(&BakedPoses::means);
    keep(&BakedPoses::quats);
    keep(&BakedPoses::log_scales);
    keep(&BakedPoses::opacities);
  }
  return left;
}

FactorPose pose_of_factor(const float* factor, const FactorPose* before) {
  FactorPose pose{{1, 0, 0, 0}, {}};
  const Eigen::Matrix3d l =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(factor).cast<double>();
  if (!l.allFinite()) {  // not drawn: its scales exceed a float
    pose.scales.fill(double(std::numeric_limits<float>::max()));
    return pose;
  }
  if (!axes_of_columns(l, pose)) {
    const FactorParts parts = parts_of_factor(factor);
    pose = {parts.quat, parts.scales};
    if (before) follow_axes(pose, *before);
  }
  double product = 0;
  for (size_t k = 0; before && k < 4; ++k) product += pose.quat[k] * before->quat[k];
  if (product < 0)
    for (double& q : pose.quat) q = -q;
  return pose;
}

BakedPoses bake_poses(Queue& queue, const HostModel& host, const std::vector<double>& times) {
  BakedPoses poses;
  poses.times = times;
  const size_t n = host.count, m = poses.moving = host.num_moving();
  if (n == 0) return poses;
  Model model(queue, host, Purpose::rendering);
  // At the rendered time, Gaussians outside their time window have no pose; at a second time they
  // have one, but no opacity.
  Buffer<cl_uint> everyone("everyone");
  everyone.ensure(queue, n);
  everyone.fill(queue, 1u);
  GaussiansAt at;
  std::vector<FactorPose> before;
  const float sigmas = window_sigmas(host.shape.cutoff);
  bool opacities_by_life = true, scales_change = false;
  for (const double time : times) {
    const float t = model.time(time);
    model.motion->at(queue, model.parameters, t, nullptr, at);
    const std::vector<float> opacities = at.opacities.read_range(queue, 0, n);
    for (size_t i = 0; i < n && opacities_by_life; ++i)
      opacities_by_life =
          std::fabs(opacities[i] - opacity_by_life(host.groups, i, t, sigmas)) < 1e-3f;
    poses.opacities.insert(poses.opacities.end(), opacities.begin(), opacities.end());
    if (m == 0) continue;
    model.motion->at(queue, model.parameters, t, &everyone, at);
    const std::vector<float> means = at.means.read_range(queue, 0, 3 * m);
    const std::vector<float> factors = at.factors.read_range(queue, 0, 9 * m);
    poses.means.insert(poses.means.end(), means.begin(), means.end());
    std::vector<FactorPose> now(m);
    for (size_t i = 0; i < m; ++i) {
      now[i] = pose_of_factor(&factors[9 * i], before.empty() ? nullptr : &before[i]);
      for (const double q : now[i].quat) poses.quats.push_back(float(q));
      for (size_t k = 0; k < 3; ++k) {
        const float log_scale = log_of_scale(float(now[i].scales[k]));
        poses.log_scales.push_back(log_scale);
        scales_change |= std::fabs(log_scale - host.groups.at("log_scales")[4 * i + k]) > 1e-5f;
      }
    }
    before = std::move(now);
  }
  if (opacities_by_life) poses.opacities.clear();
  if (!scales_change) poses.log_scales.clear();
  return poses;
}

}  // namespace gflow
