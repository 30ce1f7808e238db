// SPDX-License-Identifier: Apache-2.0
#include "optim/model/as_spacetime.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "optim/model/slice.hpp"
#include "shared/motion/native4d.h"

namespace gflow {
namespace {

Native4d row_of(const HostGroups& g, size_t i) {
  const auto row4 = [&](const char* name) {
    const float* r = &g.at(name)[4 * i];
    return make_real4(r[0], r[1], r[2], r[3]);
  };
  const float* mean = &g.at("means")[3 * i];
  Native4d row;
  row.mean = make_real3(mean[0], mean[1], mean[2]);
  row.mean_t = g.at("means_t")[i];
  row.quat = row4("quats");
  row.quat_r = row4("quats_r");
  row.log_scales = row4("log_scales");
  row.logit_opacity = g.at("logit_opacities")[i];
  return row;
}

}  // namespace

HostModel as_spacetime(HostModel model, const std::string& what) {
  if (model.shape.motion == MotionModelKind::spacetime) return model;
  if (model.shape.motion != MotionModelKind::native4d)
    throw Error(
        fmt::format("{}, but this model is {}; formats 4dgs and ply-sequence support every model",
                    what, name_of(model.shape.motion)));
  const HostGroups old = model.groups;
  HostGroups& g = model.groups;
  g.erase("quats_r");
  g["velocities"].resize(3 * model.count);
  g["half_accelerations"].assign(3 * model.count, 0);
  g["turns"].assign(4 * model.count, 0);
  for (size_t i = 0; i < model.count; ++i) {
    const Native4d row = row_of(old, i);
    const Slice cut = slice_at(row, row.mean_t);
    const double velocity[3] = {cut.velocity.x, cut.velocity.y, cut.velocity.z};
    std::copy(velocity, velocity + 3, &g["velocities"][3 * i]);
    float factor[9];
    size_t next = 0;
    for (const real3 r : {cut.factor.r1, cut.factor.r2, cut.factor.r3})
      for (const double x : {r.x, r.y, r.z}) factor[next++] = float(x);
    const FactorParts parts = parts_of_factor(factor);
    std::copy(parts.quat.begin(), parts.quat.end(), &g["quats"][4 * i]);
    const double least = std::numeric_limits<float>::min();
    for (size_t k = 0; k < 3; ++k)
      g["log_scales"][4 * i + k] = float(std::log(std::max(parts.scales[k], least)));
    g["log_scales"][4 * i + 3] = float(std::log(std::max(double(cut.norm_t), least)));
  }
  model.shape.motion = MotionModelKind::spacetime;
  return model;
}

}  // namespace gflow
