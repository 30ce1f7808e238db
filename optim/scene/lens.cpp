// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/lens.hpp"

#include <fmt/format.h>

#include <cmath>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Whether every position from the centre to (u, v) maps to a distinct position inside the stored
// image. Beyond the range they were fitted to, distortion polynomials fold back and would show the
// same place twice.
bool has_source(const Camera& camera, double u, double v) {
  constexpr int parts = 32;
  double before = 0;
  for (int i = 1; i <= parts + 1; ++i) {
    // An extra sample close to the end catches a fold just before it.
    const double t = i < parts ? double(i) / parts : i == parts ? 0.999 : 1;
    const Eigen::Vector2d at =
        stored_at(camera, camera.cx + t * (u - camera.cx), camera.cy + t * (v - camera.cy));
    const double distance = std::hypot(at.x() - camera.cx, at.y() - camera.cy);
    if (!(distance > before)) return false;
    before = distance;
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() <= camera.width && at.y() <= camera.height))
      return false;
  }
  return true;
}

bool all_have_sources(const Camera& camera) {
  constexpr int parts = 32;  // samples per side
  const double right = camera.width - 0.5, bottom = camera.height - 0.5;
  for (int i = 0; i <= parts; ++i) {
    const double x = 0.5 + (right - 0.5) * i / parts, y = 0.5 + (bottom - 0.5) * i / parts;
    if (!has_source(camera, x, 0.5) || !has_source(camera, x, bottom) ||
        !has_source(camera, 0.5, y) || !has_source(camera, right, y))
      return false;
  }
  return true;
}

}  // namespace

Eigen::Vector2d distorted(const Lens& lens, const Eigen::Vector2d& point) {
  const double x = point.x(), y = point.y(), r2 = x * x + y * y;
  const auto& k = lens.k;
  if (lens.kind == Lens::Kind::fisheye) {
    const double r = std::sqrt(r2), a = std::atan(r), a2 = a * a;
    const double bent = a * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
    return r > 0 ? Eigen::Vector2d(point * (bent / r)) : point;
  }
  const double p1 = k[2], p2 = k[3];
  const double d =
      (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return {d * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          d * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Eigen::Vector2d stored_at(const Camera& camera, double u, double v) {
  const Lens& lens = camera.lens;
  if (lens.kind == Lens::Kind::none) return {u, v};
  const Eigen::Vector2d p =
      distorted(lens, {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy});
  return {lens.fx * p.x() + lens.cx, lens.fy * p.y() + lens.cy};
}

Camera pinhole_of_lens(Camera camera, Lens::Kind kind, const std::array<double, 8>& k,
                       const std::string& what) {
  for (const double value : k)
    if (!std::isfinite(value))
      throw Error(fmt::format("{} has a distortion coefficient that is NaN or Inf", what));
  if (kind == Lens::Kind::none || (kind == Lens::Kind::radial && k == std::array<double, 8>{}))
    return camera;
  camera.lens = {kind, k, camera.fx, camera.fy, camera.cx, camera.cy};
  constexpr double most = 4;
  for (double zoom = 1; zoom < most; zoom *= 1.01) {
    camera.fx = zoom * camera.lens.fx;
    camera.fy = zoom * camera.lens.fy;
    if (all_have_sources(camera)) return camera;
  }
  throw Error(fmt::format(
      "{} has too much lens distortion: undistorting its images would lose three quarters of their "
      "width (coefficients {:.4g})",
      what, fmt::join(k.begin(), k.begin() + (kind == Lens::Kind::fisheye ? 4 : 8), ", ")));
}

Image undistorted(const Image& image, const Camera& camera) {
  if (camera.lens.kind == Lens::Kind::none) return image;
  std::vector<float> from;
  from.reserve(2 * size_t(camera.width) * size_t(camera.height));
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d at = stored_at(camera, x + 0.5, y + 0.5);
      from.push_back(float(at.x()));
      from.push_back(float(at.y()));
    }
  return remapped(image, camera.width, camera.height, from);
}

}  // namespace gflow
