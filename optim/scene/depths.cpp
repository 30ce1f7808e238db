// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/depths.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

namespace gflow {
namespace {

constexpr size_t kFewPoints = 20;  // in view of a camera: too few to tell its nearest surface

struct DepthsInView {
  const Camera* camera;
  std::vector<double> depths;  // of the points in view, ascending
};

std::set<int> training_cameras(const Scene& scene) {
  std::set<int> cameras;
  for (const Frame& frame : scene.train) cameras.insert(frame.camera);
  return cameras;
}

// Of each training camera that sees enough points.
std::vector<DepthsInView> depths_in_view(const Scene& scene) {
  constexpr size_t most = 20000;  // of many points a sample is taken
  const size_t stride = std::max<size_t>(1, scene.points.size() / most);
  std::vector<DepthsInView> all;
  for (const int index : training_cameras(scene)) {
    const Camera& camera = scene.cameras[size_t(index)];
    std::vector<double> depths;
    for (size_t i = 0; i < scene.points.size(); i += stride)
      if (const auto depth =
              camera.depth_in_view(Eigen::Map<const Eigen::Vector3d>(&scene.points.xyz[3 * i])))
        depths.push_back(*depth);
    std::sort(depths.begin(), depths.end());
    if (depths.size() >= kFewPoints) all.push_back({&camera, std::move(depths)});
  }
  return all;
}

// Depth of the nearest surface that a training camera sees; nullopt without enough points. The
// nearest hundredth of a camera's points may be errors of the reconstruction.
std::optional<double> nearest_surface(const Scene& scene) {
  std::optional<double> nearest;
  for (const auto& [camera, depths] : depths_in_view(scene)) {
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
  for (const auto& [camera, depths] : depths_in_view(scene)) {
    const auto end = std::lower_bound(depths.begin(), depths.end(), near);
    largest = std::max(largest, double(end - depths.begin()) / double(depths.size()));
  }
  return largest;
}

double pixel_size(const Scene& scene) {
  std::vector<double> sizes;
  for (const auto& [camera, depths] : depths_in_view(scene))
    sizes.push_back(depths[depths.size() / 2] / camera->fx);
  if (sizes.empty()) {
    const Eigen::Vector3d focus = focus_point(scene);
    for (const int index : training_cameras(scene)) {
      const Camera& camera = scene.cameras[size_t(index)];
      sizes.push_back((camera.position() - focus).norm() / camera.fx);
    }
  }
  std::nth_element(sizes.begin(), sizes.begin() + long(sizes.size() / 2), sizes.end());
  return sizes[sizes.size() / 2];
}

double median_depth_of_points(const Scene& scene, int camera) {
  std::vector<double> depths;
  for (size_t i = 0; i < scene.points.size(); ++i)
    if (const auto depth = scene.cameras[size_t(camera)].depth_in_view(
            Eigen::Map<const Eigen::Vector3d>(&scene.points.xyz[3 * i])))
      depths.push_back(*depth);
  if (depths.size() < kFewPoints) return 0;
  const auto middle = depths.begin() + long(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

double size_of_scene(const Scene& scene) {
  std::vector<double> depths;
  const size_t stride = std::max<size_t>(1, scene.train.size() / 20);
  for (size_t i = 0; i < scene.train.size(); i += stride)
    depths.push_back(median_depth_of_points(scene, scene.train[i].camera));
  std::nth_element(depths.begin(), depths.begin() + long(depths.size() / 2), depths.end());
  return std::max(scene.extent, depths[depths.size() / 2]);
}

double depth_of_scene(const Scene& scene, int camera) {
  if (const double median = median_depth_of_points(scene, camera); median > 0) return median;
  const Camera& from = scene.cameras[size_t(camera)];
  const double depth = from.viewmat.row(2).dot(focus_point(scene).homogeneous());
  return depth > 0 ? depth : scene.extent;
}

}  // namespace gflow
