// SPDX-License-Identifier: Apache-2.0
// A guidance request for tests.
#pragma once
#include <cmath>

#include "optim/guidance/guidance.hpp"
#include "shared/random.h"

namespace gflow {

inline std::vector<float> some_values(uint stream, size_t count) {
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = float(random_uniform(1u, stream, uint(i)));
  return values;
}

inline Camera some_camera(const std::string& name, int width, int height) {
  Camera camera;
  camera.name = name;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 1.5 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.viewmat(2, 3) = 3;
  return camera;
}

inline GuidanceRequest some_request(int views, int width, int height, bool flow = false) {
  const size_t pixels = size_t(width) * size_t(height);
  GuidanceRequest request;
  request.step = 7;
  request.steps = 20;
  request.progress = 0.25;
  request.seed = 11;
  request.time = 0.5;
  request.frame = 2;
  request.next_frame = 3;
  request.wants_flow = flow;
  request.next_time = 0.75;
  request.reference.camera = some_camera("input", width, height);
  request.reference.rgb = some_values(90, 3 * pixels);
  for (int v = 0; v < views; ++v) {
    GuidanceView view;
    view.camera = some_camera("eval_" + std::to_string(v), width, height);
    view.azimuth = 30 + v;
    view.elevation = -10;
    view.distance = 0.5;
    view.rgb = some_values(uint(10 * v), 3 * pixels);
    if (flow) view.flow = some_values(uint(10 * v + 5), 2 * pixels);
    request.views.push_back(view);
  }
  return request;
}

}  // namespace gflow
