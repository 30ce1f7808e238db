// SPDX-License-Identifier: Apache-2.0
// A small model of any kind, as read from a file.
#pragma once
#include <map>
#include <random>
#include <string>

#include "optim/model/model.hpp"

namespace gflow {

// Random values in [-2, 2), regardless of their meaning.
inline HostModel random_model(size_t count, int sh_degree,
                              MotionModelKind kind = MotionModelKind::spacetime) {
  std::mt19937 rng(7);
  HostModel model;
  model.count = count;
  model.shape.motion = kind;
  model.shape.sh_degree = sh_degree;
  model.shape.duration = 3.7f;
  model.shape.cutoff = 0.031f;
  if (kind == MotionModelKind::keyframes || kind == MotionModelKind::bases) model.shape.keys = 3;
  model.shape.key_scales = kind == MotionModelKind::keyframes;
  if (kind == MotionModelKind::bases) model.shape.bases = 2;
  model.shape.hexplane.resolution = 4;
  model.shape.hexplane.times = 3;
  model.shape.hexplane.levels = 1;
  model.shape.hexplane.hidden = 32;
  model.shape.hexplane.layers = 1;
  model.shape.hexplane.centre = {-1.7f, 0.f, 0.1f};  // both signs and 0
  model.shape.hexplane.half_size = {0.3f, 2.f, 5.f};
  const size_t rest = size_t((sh_degree + 1) * (sh_degree + 1) - 1);
  std::map<std::string, size_t> widths{{"means", 3},         {"means_t", 1},         {"quats", 4},
                                       {"log_scales", 4},    {"logit_opacities", 1}, {"sh0", 3},
                                       {"sh_rest", 3 * rest}};
  for (const MotionColumns& columns : motion_columns(model.shape))
    widths[columns.group] = columns.properties.size();
  std::map<std::string, size_t> sizes;
  for (const auto& [name, width] : widths) sizes[name] = width * count;
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups)
      sizes[group.name] = group.width * table.count(count);
  for (const auto& [name, size] : sizes) {
    model.groups[name];
    for (size_t i = 0; i < size; ++i)
      model.groups[name].push_back(float(rng()) / 4294967296.f * 4 - 2);
  }
  return model;
}

}  // namespace gflow
