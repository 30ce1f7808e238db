// SPDX-License-Identifier: Apache-2.0
// Small random scenes for tests of the engine. Every value is a float32 stored as double, so that
// the reference and the device get the same numbers.
#pragma once
#include <cmath>
#include <random>

#include "optim/reference/parameters.hpp"

namespace gflow {

// Gaussians posed at two times (reference::posed), and the cameras and settings to render them.
struct PosedScene {
  reference::Shot shot;
  reference::Named p;
  size_t count() const { return p.at("opacities").size(); }
  size_t pixels() const { return size_t(shot.camera.width) * shot.camera.height; }
};

struct SceneSpec {
  size_t n = 100;
  int width = 32, height = 32;
  unsigned seed = 1;
  double cover = 15;    // mean number of Gaussians that touch a pixel
  double aspect = .5;   // standard deviation of the three log scales
  double spread = 1.2;  // extent of the centres; 1: to the image's border
  double opaque = 0;    // fraction of Gaussians with opacity in (0.99, 1]
};

// Sets a camera's pose (world to camera) from a quaternion (w x y z) and a translation.
inline void place(PinholeCamera& camera, real4 quat, real3 translation) {
  const Mat3 r = quat_to_rotmat(quat_normalize(quat).q);
  const real3 rows[3] = {r.r1, r.r2, r.r3};
  for (int i = 0; i < 3; ++i) {
    camera.rotation[3 * i] = float(rows[i].x);
    camera.rotation[3 * i + 1] = float(rows[i].y);
    camera.rotation[3 * i + 2] = float(rows[i].z);
  }
  camera.translation[0] = float(translation.x);
  camera.translation[1] = float(translation.y);
  camera.translation[2] = float(translation.z);
}
inline PinholeCamera test_camera(int width, int height) {
  PinholeCamera c{};
  place(c, {1, 0, 0, 0}, {0, 0, 0});
  c.fx = float(std::max(width, height));
  c.fy = c.fx * 1.1f;
  c.cx = 0.49f * float(width);
  c.cy = 0.52f * float(height);
  c.near_plane = 0.01f;
  c.width = width;
  c.height = height;
  return c;
}
// World position of a point in camera coordinates.
inline real3 world_of(const PinholeCamera& c, real3 p) {
  const real3 d = p - make_real3(c.translation[0], c.translation[1], c.translation[2]);
  const float* r = c.rotation;
  return make_real3(r[0] * d.x + r[3] * d.y + r[6] * d.z, r[1] * d.x + r[4] * d.y + r[7] * d.z,
                    r[2] * d.x + r[5] * d.y + r[8] * d.z);
}

inline void append(reference::Named& p, const std::string& name, std::vector<double> values) {
  for (double v : values) p[name].push_back(double(float(v)));
}

inline PosedScene random_scene(const SceneSpec& spec) {
  std::mt19937 rng(spec.seed);
  const auto uniform = [&](double lo, double hi) {
    return lo + (hi - lo) * (double(rng()) / 4294967296.0);
  };
  const auto normal = [&] {  // std::normal_distribution differs between libraries
    return std::sqrt(-2 * std::log(uniform(1e-12, 1))) *
           std::cos(6.283185307179586 * uniform(0, 1));
  };
  PosedScene s;
  s.shot.camera = s.shot.camera_t2 = test_camera(spec.width, spec.height);
  place(s.shot.camera, {.95, .09, .3, -.06}, {.1, -.2, .3});
  place(s.shot.camera_t2, {.95, .095, .301, -.06}, {.12, -.19, .27});
  const double background[3] = {.25, .375, .625};
  std::copy(background, background + 3, s.shot.background);
  const PinholeCamera& c = s.shot.camera;
  // Area of alpha >= 1/255 at a typical opacity of .3: 2 pi ln(76) sigma^2 = 27 sigma^2.
  const double area = double(spec.width) * spec.height * spec.spread * spec.spread;
  const double sigma = std::sqrt(spec.cover * area / (27.0 * double(std::max<size_t>(spec.n, 1))));
  for (const char* name :
       {"means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2"})
    s.p[name];
  for (size_t i = 0; i < spec.n; ++i) {
    const double z = uniform(2, 10);
    const double u = uniform(-.5, .5) * spec.spread * c.width / c.fx;
    const double v = uniform(-.5, .5) * spec.spread * c.height / c.fy;
    const real3 mean = world_of(c, {u * z, v * z, z});
    const double size = sigma * z / c.fx * std::exp(.4 * normal());
    const double sx = size * std::exp(spec.aspect * normal());
    const double sy = size * std::exp(spec.aspect * normal());
    const double sz = size * std::exp(spec.aspect * normal());
    const real4 q{normal(), normal(), normal(), normal()};
    const double faint = 1 / (1 + std::exp(1 - 1.2 * normal()));
    const double opacity = uniform(0, 1) < spec.opaque ? uniform(.991, 1) : std::min(faint, .95);
    append(s.p, "means", {mean.x, mean.y, mean.z});
    append(s.p, "quats", {q.x, q.y, q.z, q.w});
    append(s.p, "scales", {sx, sy, sz});
    append(s.p, "opacities", {opacity});
    append(s.p, "colors", {uniform(0, 1), uniform(0, 1), uniform(0, 1)});
    append(s.p, "means_t2",
           {mean.x + .03 + .01 * normal(), mean.y - .02 + .01 * normal(),
            mean.z + .04 + .01 * normal()});
    append(
        s.p, "quats_t2",
        {q.x + .03 * normal(), q.y + .03 * normal(), q.z + .03 * normal(), q.w + .03 * normal()});
    append(s.p, "scales_t2",
           {sx * std::exp(.03 * normal()), sy * std::exp(.03 * normal()),
            sz * std::exp(.03 * normal())});
  }
  return s;
}

// Adds a Gaussian at camera coordinates `at`, with three scales and no rotation of its own. It
// moves by `shift` (camera coordinates) until t2.
inline void add_gaussian(PosedScene& s, real3 at, real3 scales, double opacity,
                         real3 shift = {0, 0, 0}) {
  const real3 a = world_of(s.shot.camera, at), b = world_of(s.shot.camera, at + shift);
  append(s.p, "means", {a.x, a.y, a.z});
  append(s.p, "means_t2", {b.x, b.y, b.z});
  append(s.p, "opacities", {opacity});
  append(s.p, "colors", {.9, .5, .2});
  for (const std::string end : {"", "_t2"}) {
    append(s.p, "quats" + end, {1, 0, 0, 0});
    append(s.p, "scales" + end, {scales.x, scales.y, scales.z});
  }
}

// Random cotangents of order 1/sqrt(pixels) as float32 values, 0 at doubtful pixels.
inline reference::Planes random_cotangents(const PosedScene& s, unsigned seed,
                                           const std::vector<uint8_t>& doubtful = {}) {
  std::mt19937 rng(seed);
  const size_t pixels = s.pixels();
  const auto plane = [&](size_t channels, double size) {
    std::vector<double> v(channels * pixels);
    for (size_t i = 0; i < v.size(); ++i) {
      v[i] = double(float(size * (double(rng()) / 2147483648.0 - 1) / std::sqrt(double(pixels))));
      if (!doubtful.empty() && doubtful[i % pixels]) v[i] = 0;
    }
    return v;
  };
  reference::Planes v;
  v.rgb = plane(3, 1);
  v.alpha = plane(1, 1);
  v.depth = plane(1, .1);
  v.flow = plane(2, .1);
  return v;
}
// The cotangents of one image, others 0: "rgb", "alpha", "depth" or "flow".
inline reference::Planes only(reference::Planes v, const std::string& image) {
  if (image != "rgb") std::fill(v.rgb.begin(), v.rgb.end(), 0.0);
  if (image != "alpha") std::fill(v.alpha.begin(), v.alpha.end(), 0.0);
  if (image != "depth") std::fill(v.depth.begin(), v.depth.end(), 0.0);
  if (image != "flow") std::fill(v.flow.begin(), v.flow.end(), 0.0);
  return v;
}

inline double largest(const std::vector<double>& a) {
  double most = 0;
  for (double x : a) most = std::max(most, std::fabs(x));
  return most;
}

}  // namespace gflow
