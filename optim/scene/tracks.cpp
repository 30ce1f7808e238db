// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/tracks.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "optim/scene/readers/reader_util.hpp"

namespace gflow {
namespace {

constexpr double flow_reach = 0.2;  // largest displacement for dense flow / image width
constexpr double same_time = 1e-9;  // [video durations]

// Depth of the scene from a camera: the median of its points. Without points the scene is assumed
// to be about the origin, as in D-NeRF, but at least `extent`, the radius of the camera's path,
// away.
double depth_of_scene(const Scene& scene, double extent, const Camera& camera) {
  std::vector<double> depths;
  for (size_t i = 0; i < scene.points.size(); ++i) {
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3d>(&scene.points.xyz[3 * i]);
    const double z = (camera.viewmat * point.homogeneous()).z();
    if (z > 0) depths.push_back(z);
  }
  if (depths.empty()) return std::max(camera.position().norm(), extent);
  const auto middle = depths.begin() + long(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

// World point seen at a pixel at depth z.
Eigen::Vector3d point_at(const Camera& camera, const Eigen::Vector2d& pixel, double z) {
  const Eigen::Vector3d p(z * (pixel.x() - camera.cx) / camera.fx,
                          z * (pixel.y() - camera.cy) / camera.fy, z);
  return camera.viewmat.topLeftCorner<3, 3>().transpose() * p + camera.position();
}

}  // namespace

bool are_near(const Camera& from, const Camera& to, double depth) {
  if (from.width != to.width || from.height != to.height) return false;
  for (const double z : {0.5 * depth, depth, 2 * depth})
    for (const double x : {0., 0.5, 1.})
      for (const double y : {0., 0.5, 1.}) {
        const Eigen::Vector2d pixel(x * from.width, y * from.height);
        const Eigen::Vector3d point = point_at(from, pixel, z);
        if (!((to.viewmat * point.homogeneous()).z() > 0)) return false;
        if (!((to.project(point) - pixel).norm() < flow_reach * from.width)) return false;
      }
  return true;
}

void find_tracks(const Scene& scene, std::vector<Frame>& frames) {
  std::vector<Frame*> by_time;
  for (Frame& frame : frames) {
    frame.track = frame.camera;
    by_time.push_back(&frame);
  }
  std::stable_sort(by_time.begin(), by_time.end(),
                   [](const Frame* a, const Frame* b) { return a->time < b->time; });
  const double extent = scene.points.size() == 0 ? scene_extent(scene) : 0;
  size_t smooth = 0;
  std::vector<bool> goes_on(by_time.size());
  for (size_t i = 1; i < by_time.size(); ++i) {
    const Frame &before = *by_time[i - 1], &frame = *by_time[i];
    if (frame.time - before.time < same_time) return;  // several cameras
    const Camera& from = scene.cameras[size_t(before.camera)];
    const Camera& to = scene.cameras[size_t(frame.camera)];
    goes_on[i] =
        before.camera == frame.camera || are_near(from, to, depth_of_scene(scene, extent, from));
    smooth += goes_on[i];
  }
  if (2 * smooth + 1 <= by_time.size()) return;
  for (size_t i = 0; i < by_time.size(); ++i)
    by_time[i]->track = i == 0 ? 0 : by_time[i - 1]->track + !goes_on[i];
}

}  // namespace gflow
