// SPDX-License-Identifier: Apache-2.0
// Images with known flow between them.
#pragma once
#include <cmath>

#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

// A smooth texture moved by (dx, dy), so that the flow is known everywhere.
inline gflow::Image texture(int width, int height, double dx, double dy) {
  gflow::Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double u = x - dx, v = y - dy;
        image.pixels.push_back(uint8_t(128 + 50 * std::sin(u * .35) * std::cos(v * .27) +
                                       40 * std::sin(u * .11 + v * .19)));
      }
  return image;
}

// Time steps of one camera, 48 x 40, each moved by (2, -1), without true flow.
inline gflow::Scene textured_scene(const TemporaryFolder& folder, int steps = 3) {
  for (int k = 0; k < steps; ++k)
    gflow::write_png(folder.file(fmt::format("scene/{}.png", k)), texture(48, 40, 2 * k, -k));
  return gflow::read_scene(folder.path() + "/scene");
}

inline gflow::FlowField uniform(int width, int height, float u, float v) {
  gflow::FlowField flow = gflow::zero_flow(width, height);
  for (size_t i = 0; i < flow.valid.size(); ++i) flow.uv[2 * i] = u, flow.uv[2 * i + 1] = v;
  return flow;
}
