// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/near_plane.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

namespace gflow {
namespace {

constexpr size_t kFewPoints = 20;  // in view of a camera: too few to tell its nearest surface

// Depths of the points in view of each training camera that sees enough of them, ascending.
std::vector<std::vector<double>> depths_in_view(const Scene& scene) {
  constexpr size_t most = 20000;  // of many points a sample is taken
  const size_t stride = std::max<size_t>(1, scene.points.size() / most);
  std::set<int> cameras;
  for (const Frame& frame : scene.train) cameras.insert(frame.camera);
  std::vector<std::vector<double>> all;
  for (const int index : cameras) {
    const Camera& camera = scene.cameras[size_t(index)];
    std::vector<double> depths;
    for (size_t i = 0; i < scene.points.size(); i += stride)
      if (const auto depth =
              camera.depth_in_view(Eigen::Map<const Eigen::Vector3d>(&scene.points.xyz[3 * i])))
        depths.push_back(*depth);
    std::sort(depths.begin(), depths.end());
    if (depths.size() >= kFewPoints) all.push_back(std::move(depths));
  }
  return all;
}

// Depth of the nearest surface that a training camera sees; nullopt without enough points. The
// nearest hundredth of a camera's points may be errors of the reconstruction.
std::optional<double> nearest_surface(const Scene& scene) {
  std::optional<double> nearest;
  for (const std::vector<double>& depths : depths_in_view(scene)) {
    const double depth = depths[depths.size() / 100];
    nearest = std::min(nearest.value_or(depth), depth);
  }
  return nearest;
}

// Two digits: the value stands in config.toml.
double rounded(double x) {
  const double unit = std::pow(10., std::floor(std::log10(x)) - 1);
  return std::round(x / unit) * unit;
}

}  // namespace

double near_plane_of(const Scene& scene) {
  if (scene.near > 0) return rounded(0.5 * scene.near);
  if (const auto surface = nearest_surface(scene)) return rounded(0.25 * *surface);
  return rounded(0.01 * scene.extent);
}

double share_of_points_nearer(const Scene& scene, double near) {
  double largest = 0;
  for (const std::vector<double>& depths : depths_in_view(scene)) {
    const auto end = std::lower_bound(depths.begin(), depths.end(), near);
    largest = std::max(largest, double(end - depths.begin()) / double(depths.size()));
  }
  return largest;
}

}  // namespace gflow
