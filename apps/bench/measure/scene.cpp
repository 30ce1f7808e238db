// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "optim/engine/splat_file.hpp"
#include "shared/constants.h"

namespace gflow::bench {
namespace {

constexpr double kContributors = 50;  // target of contributors per pixel without saturation

// The projected shape of a splat before dilation.
struct Shape {
  double x, y, length, width, turn, opacity;
};

std::vector<Shape> shapes(int width, int height, size_t count, double scale) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<Shape> all(count);
  for (Shape& s : all) {
    s.x = uniform(rng) * (width + 16) - 8;
    s.y = uniform(rng) * (height + 16) - 8;
    const double size = scale * std::exp(0.5 * normal(rng));
    const double aspect = std::exp(0.25 * std::fabs(normal(rng)));
    s.turn = uniform(rng) * M_PI;
    s.length = size * aspect;
    s.width = size / aspect;
    s.opacity = 1 / (1 + std::exp(0.2 - 1.5 * normal(rng)));
  }
  return all;
}

// Expected contributors per pixel without saturation: sum of ellipse areas / image area.
double coverage(int width, int height, size_t count, double scale) {
  double area = 0;
  for (const Shape& s : shapes(width, height, count, scale)) {
    const double reach = 2 * std::log(255 * s.opacity);
    const double a = s.length * s.length + DILATION, b = s.width * s.width + DILATION;
    if (reach > 0) area += M_PI * reach * std::sqrt(a * b);
  }
  return area / ((width + 16.0) * (height + 16.0));
}

double scale_for(int width, int height, size_t count) {
  double low = 0.05, high = 60;
  for (int i = 0; i < 12; ++i) {
    const double middle = std::sqrt(low * high);
    (coverage(width, height, count, middle) < kContributors ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

PinholeCamera camera_before(int width, int height) {
  PinholeCamera camera{};
  camera.rotation[0] = camera.rotation[4] = camera.rotation[8] = 1;
  camera.fx = camera.fy = float(width);
  camera.cx = 0.5f * float(width);
  camera.cy = 0.5f * float(height);
  camera.near_plane = 0.01f;
  camera.width = width;
  camera.height = height;
  return camera;
}

}  // namespace

ImageGradients random_gradients(Queue& queue, size_t pixels, Channels channels) {
  std::mt19937 rng(7);
  std::normal_distribution<float> normal;
  const auto noise = [&](size_t n, const char* name) {
    std::vector<float> values(n);
    for (float& value : values) value = normal(rng);
    return Buffer<float>(queue, values, name);
  };
  ImageGradients v;
  v.v_rgb = noise(3 * pixels, "v_rgb");
  v.v_alpha = noise(pixels, "v_alpha");
  if (channels.flow) v.v_flow = noise(2 * pixels, "v_flow");
  if (channels.depth) v.v_depth = noise(pixels, "v_depth");
  return v;
}

BenchScene random_scene(Queue& queue, int width, int height, size_t count, size_t frames) {
  BenchScene scene;
  scene.name = fmt::format("{}x{}, {}", width, height, count);
  scene.count = count * frames;
  scene.t1 = float(frames / 2);
  scene.t2 = scene.t1 + 1;
  scene.view.camera = scene.view.camera_t2 = camera_before(width, height);
  const PinholeCamera& camera = scene.view.camera;
  std::mt19937 rng(2);
  std::uniform_real_distribution<float> uniform;
  HostGroups g;
  std::vector<float> colors;
  const auto append = [&](const char* name, std::initializer_list<double> values) {
    for (const double x : values) g[name].push_back(float(x));
  };
  const std::vector<Shape> all = shapes(width, height, count, scale_for(width, height, count));
  for (size_t i = 0; i < scene.count; ++i) {
    const Shape& s = all[i % count];
    const double z = 1 + 9 * double(uniform(rng)), unit = z / camera.fx;
    append("means", {(s.x - camera.cx) * unit, (s.y - camera.cy) * unit, z});
    append("velocities", {unit * (double(uniform(rng)) - 0.5), unit, 0});
    append("half_accelerations", {0, 0, 0});
    append("means_t", {double(i / count)});
    append("quats", {std::cos(0.5 * s.turn), 0, 0, std::sin(0.5 * s.turn)});
    append("turns", {0, 0, 0, 0.02});
    // Flat and facing the camera, so that the projected size is length x width.
    append("log_scales", {std::log(s.length * unit), std::log(s.width * unit),
                          std::log(1e-3 * s.width * unit), std::log(frames > 1 ? 0.1 : 100.)});
    append("logit_opacities", {std::log(s.opacity / (1 - s.opacity))});
    for (int c = 0; c < 3; ++c) colors.push_back(uniform(rng));
  }
  MotionShape shape;
  scene.motion = make_motion(queue, shape);
  scene.parameters = std::make_unique<Parameters>(queue, scene.count, scene.motion->groups(),
                                                  scene.motion->tables());
  for (const auto& [name, values] : g) (*scene.parameters)[name].values.write(queue, values);
  scene.colors = Buffer<float>(queue, colors, "colors");
  return scene;
}

BenchScene scene_of_file(Queue& queue, const std::string& path, bool flow) {
  SplatScene file = splat_scene(queue, read_npz(path, splat_arrays_known), 0.01f, path);
  if (flow && !file.moves)
    throw Error(
        fmt::format("reading {}: flow needs the second time: means_t2, quats_t2, "
                    "scales_t2; --no-flow does without",
                    path));
  BenchScene scene;
  scene.name = path;
  scene.count = file.count;
  scene.view = file.view;
  scene.at_t1 = std::move(file.t1);
  scene.at_t2 = std::move(file.t2);
  scene.colors = std::move(file.colors);
  return scene;
}

}  // namespace gflow::bench
