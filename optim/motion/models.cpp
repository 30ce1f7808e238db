// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/models.hpp"

#include <algorithm>
#include <cmath>

#include "optim/motion/native4d.hpp"
#include "optim/motion/spacetime.hpp"

namespace gflow {
namespace {

// The two unit quaternions (w x y z) of a 4D rotation that gives a Gaussian with spatial scale s
// and temporal scale s_t the velocity v (kernels/shared/native4d.h).
struct QuatPair {
  std::array<float, 4> left, right;
};
QuatPair quats_for_velocity(const std::array<double, 3>& v, double s, double s_t) {
  const double speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  if (speed == 0) return {{1, 0, 0, 0}, {1, 0, 0, 0}};
  // speed = (1 - r^2) tau / (1 + r^2 tau^2), r = s/s_t, tau = tan of the angle between v and time
  const double rr = (s / s_t) * (s / s_t), b = 1 - rr;
  const double discriminant = b * b - 4 * speed * speed * rr;
  const double tau = discriminant > 0 ? 2 * speed / (b + std::sqrt(discriminant)) : s_t / s;
  const double half = 0.5 * std::atan(tau), k = std::sin(half) / speed;
  const auto f = [](double value) { return float(value); };
  const double w = std::cos(half);
  return {{f(w), f(k * v[0]), f(k * v[1]), f(k * v[2])},
          {f(w), f(-k * v[0]), f(-k * v[1]), f(-k * v[2])}};
}

}  // namespace

std::unique_ptr<Motion> make_motion(Queue& queue, MotionModelKind kind, float cutoff) {
  if (kind == MotionModelKind::native4d) return std::make_unique<Native4dMotion>(queue, cutoff);
  return std::make_unique<SpacetimeMotion>(queue, cutoff);
}

std::vector<MotionColumns> motion_columns(MotionModelKind kind) {
  if (kind == MotionModelKind::native4d)
    return {{"quats_r", {"rot_r_0", "rot_r_1", "rot_r_2", "rot_r_3"}}};
  return {{"velocities", {"motion_0", "motion_1", "motion_2"}},
          {"half_accelerations", {"motion_3", "motion_4", "motion_5"}},
          {"turns", {"omega_0", "omega_1", "omega_2", "omega_3"}}};
}

void add_rest(MotionModelKind kind, HostGroups& groups, size_t count) {
  for (const MotionColumns& columns : motion_columns(kind))
    groups[columns.group].assign(columns.properties.size() * count, 0.f);
  if (kind == MotionModelKind::native4d) groups["quats_r"] = groups.at("quats");
}

void set_velocity(MotionModelKind kind, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t) {
  if (kind == MotionModelKind::native4d) {
    const QuatPair q = quats_for_velocity(v, s, s_t);
    std::copy(q.left.begin(), q.left.end(), &groups.at("quats")[4 * i]);
    std::copy(q.right.begin(), q.right.end(), &groups.at("quats_r")[4 * i]);
    return;
  }
  for (size_t k = 0; k < 3; ++k) groups.at("velocities")[3 * i + k] = float(v[k]);
}

bool at_rest(MotionModelKind kind, const HostGroups& groups) {
  if (kind == MotionModelKind::native4d) return groups.at("quats") == groups.at("quats_r");
  for (const MotionColumns& columns : motion_columns(kind)) {
    const std::vector<float>& values = groups.at(columns.group);
    if (std::any_of(values.begin(), values.end(), [](float x) { return x != 0; })) return false;
  }
  return true;
}

}  // namespace gflow
