// SPDX-License-Identifier: Apache-2.0
// Rows of the spacetime model in double, as a flat list and as the groups of
// optim/motion/spacetime.hpp.
#pragma once
#include "optim/reference/parameters.hpp"
#include "shared/motion/spacetime.h"

namespace gflow::reference {

inline std::vector<double> flat(const Spacetime& g) {
  return {g.mean.x,
          g.mean.y,
          g.mean.z,
          g.mean_t,
          g.velocity.x,
          g.velocity.y,
          g.velocity.z,
          g.half_acceleration.x,
          g.half_acceleration.y,
          g.half_acceleration.z,
          g.quat.x,
          g.quat.y,
          g.quat.z,
          g.quat.w,
          g.turn.x,
          g.turn.y,
          g.turn.z,
          g.turn.w,
          g.log_scales.x,
          g.log_scales.y,
          g.log_scales.z,
          g.log_scales.w,
          g.logit_opacity};
}
inline Spacetime spacetime_from(const std::vector<double>& x) {
  Spacetime g;
  g.mean = {x[0], x[1], x[2]};
  g.mean_t = x[3];
  g.velocity = {x[4], x[5], x[6]};
  g.half_acceleration = {x[7], x[8], x[9]};
  g.quat = {x[10], x[11], x[12], x[13]};
  g.turn = {x[14], x[15], x[16], x[17]};
  g.log_scales = {x[18], x[19], x[20], x[21]};
  g.logit_opacity = x[22];
  return g;
}

inline Named spacetime_groups(const std::vector<Spacetime>& rows) {
  const std::vector<std::pair<const char*, size_t>> widths{
      {"means", 3}, {"means_t", 1}, {"velocities", 3}, {"half_accelerations", 3},
      {"quats", 4}, {"turns", 4},   {"log_scales", 4}, {"logit_opacities", 1}};
  Named groups;
  for (const Spacetime& row : rows) {
    const std::vector<double> x = flat(row);
    size_t at = 0;
    for (const auto& [name, width] : widths) {
      groups[name].insert(groups[name].end(), x.begin() + long(at), x.begin() + long(at + width));
      at += width;
    }
  }
  return groups;
}

}  // namespace gflow::reference
