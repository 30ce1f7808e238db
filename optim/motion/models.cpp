// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/models.hpp"

#include <algorithm>
#include <cmath>

#include "optim/motion/bases.hpp"
#include "optim/motion/hexplane.hpp"
#include "optim/motion/keyframes.hpp"
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

std::unique_ptr<Motion> make_motion(Queue& queue, const MotionShape& shape) {
  switch (shape.motion) {
    case MotionModelKind::spacetime:
      return std::make_unique<SpacetimeMotion>(queue, shape.cutoff);
    case MotionModelKind::native4d:
      return std::make_unique<Native4dMotion>(queue, shape.cutoff);
    case MotionModelKind::keyframes:
      return std::make_unique<KeyframesMotion>(queue, shape);
    case MotionModelKind::hexplane:
      return std::make_unique<HexplaneMotion>(queue, shape);
    case MotionModelKind::bases:
      return std::make_unique<BasesMotion>(queue, shape);
  }
  throw Error("there is no such motion model");
}

std::vector<MotionColumns> motion_columns(const MotionShape& shape) {
  switch (shape.motion) {
    case MotionModelKind::spacetime:
      return {{"velocities", {"motion_0", "motion_1", "motion_2"}},
              {"half_accelerations", {"motion_3", "motion_4", "motion_5"}},
              {"turns", {"omega_0", "omega_1", "omega_2", "omega_3"}}};
    case MotionModelKind::native4d:
      return {{"quats_r", {"rot_r_0", "rot_r_1", "rot_r_2", "rot_r_3"}}};
    case MotionModelKind::keyframes:
    case MotionModelKind::hexplane:
      return {};
    case MotionModelKind::bases: {
      MotionColumns columns{"basis_logits", {}};
      for (int b = 0; b < shape.bases; ++b)
        columns.properties.push_back(fmt::format("basis_{}", b));
      return {columns};
    }
  }
  return {};
}

std::vector<GroupSpec> motion_groups(const MotionShape& shape) {
  switch (shape.motion) {
    case MotionModelKind::spacetime:
      return spacetime_groups();
    case MotionModelKind::native4d:
      return native4d_groups();
    case MotionModelKind::bases:
      return bases_groups(shape.bases);
    case MotionModelKind::keyframes:
    case MotionModelKind::hexplane:
      return still_groups();
  }
  return {};
}

std::vector<TableSpec> motion_tables(const MotionShape& shape) {
  if (shape.motion == MotionModelKind::keyframes) return keyframes_tables(shape);
  if (shape.motion == MotionModelKind::bases) return bases_tables(shape.keys, shape.bases);
  if (shape.motion == MotionModelKind::hexplane) return hexplane_tables(shape.hexplane);
  return {};
}

void add_rest(const MotionShape& shape, HostGroups& groups, size_t count, uint32_t seed) {
  for (const MotionColumns& columns : motion_columns(shape))
    groups[columns.group].assign(columns.properties.size() * count, 0.f);
  for (const TableSpec& table : motion_tables(shape))
    for (const GroupSpec& group : table.groups)
      groups[group.name].assign(group.width * table.count(count), 0.f);
  if (shape.motion == MotionModelKind::native4d) groups["quats_r"] = groups.at("quats");
  if (shape.motion == MotionModelKind::hexplane) set_hexplane_rest(shape.hexplane, groups, seed);
}

void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t) {
  const auto set3 = [&](const char* group, size_t row, double times) {
    for (size_t c = 0; c < 3; ++c) groups.at(group)[3 * row + c] = float(times * v[c]);
  };
  if (shape.motion == MotionModelKind::native4d) {
    const QuatPair q = quats_for_velocity(v, s, s_t);
    std::copy(q.left.begin(), q.left.end(), &groups.at("quats")[4 * i]);
    std::copy(q.right.begin(), q.right.end(), &groups.at("quats_r")[4 * i]);
  }
  if (shape.motion == MotionModelKind::spacetime) set3("velocities", i, 1);
  if (shape.motion == MotionModelKind::keyframes) {
    const size_t count = groups.at("means_t").size();
    const double own = groups.at("means_t")[i];
    const double step = double(shape.duration) / std::max(shape.keys - 1, 1);
    const double most = std::max(3 * s_t, 2 * step);  // nobody knows what it does later
    for (size_t k = 0; k < size_t(shape.keys); ++k)
      set3("key_shifts", k * count + i, std::clamp(double(k) * step - own, -most, most));
  }
}

bool at_rest(const MotionShape& shape, const HostGroups& groups) {
  if (shape.motion == MotionModelKind::native4d) return groups.at("quats") == groups.at("quats_r");
  if (shape.motion == MotionModelKind::hexplane) return hexplane_at_rest(shape.hexplane, groups);
  const auto zero = [&](const std::string& group) {
    const std::vector<float>& values = groups.at(group);
    return std::all_of(values.begin(), values.end(), [](float x) { return x == 0; });
  };
  if (shape.motion == MotionModelKind::bases) return zero("basis_shifts") && zero("basis_turns");
  for (const MotionColumns& columns : motion_columns(shape))
    if (!zero(columns.group)) return false;
  for (const TableSpec& table : motion_tables(shape))
    for (const GroupSpec& group : table.groups)
      if (!zero(group.name)) return false;
  return true;
}

}  // namespace gflow
