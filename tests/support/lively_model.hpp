// SPDX-License-Identifier: Apache-2.0
// A model of any kind that uses all its parameters, and its rendered image.
#pragma once
#include "optim/model/renderer.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {

// 60 Gaussians of all shapes that move, rotate, appear and disappear.
inline HostModel lively_model(MotionModelKind kind) {
  HostModel model;
  model.shape.motion = kind;
  model.shape.hexplane.times = 16;
  model.shape.sh_degree = 1;
  model.shape.duration = 2;
  model.shape.keys = 4;
  model.shape.bases = 3;
  for (uint i = 0; i < 60; ++i)
    append_gaussian(model, {noise(20, i), noise(21, i), 0.5f * noise(22, i)}, 0.1f, some_color(i),
                    0);
  for (const char* name : {"velocities", "half_accelerations", "turns"}) model.groups.erase(name);
  auto& g = model.groups;
  for (uint i = 0; i < 60; ++i) {
    g["means_t"][i] = 1 + noise(23, i);
    for (uint k = 0; k < 4; ++k) g["quats"][4 * i + k] += 0.9f * noise(24 + k, i);
    for (uint k = 0; k < 3; ++k) g["log_scales"][4 * i + k] = -2.3f + 0.8f * noise(28 + k, i);
    g["log_scales"][4 * i + 3] = noise(31, i) - 1;
    g["logit_opacities"][i] = 2 * noise(32, i);
    for (uint k = 0; k < 9; ++k) g["sh_rest"].push_back(0.3f * noise(33 + k, i));
  }
  set_static(model.shape, g, 60);
  for (const MotionColumns& columns : motion_columns(model.shape))
    for (size_t k = 0; k < g[columns.group].size(); ++k)
      g[columns.group][k] += 0.4f * noise(50, uint(k));
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups)
      for (size_t k = 0; k < g[group.name].size(); ++k)
        g[group.name][k] += 0.1f * noise(51, uint(k));
  return model;
}

// Its rendered colours in planes.
inline std::vector<float> drawn(Queue& queue, const HostModel& host, double time,
                                const Camera& camera) {
  Renderer renderer(queue, {});
  Model model(queue, host);
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
  shot.time = time;
  renderer.forward(queue, model, shot);
  return renderer.images().rgb.read(queue);
}

}  // namespace gflow
