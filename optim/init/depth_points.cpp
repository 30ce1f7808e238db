// SPDX-License-Identifier: Apache-2.0
#include "optim/init/depth_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <map>

#include "optim/engine/random_streams.hpp"
#include "optim/scene/depth_map.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

std::vector<const Frame*> frames_at_best_step(const Scene& scene) {
  std::map<int, std::vector<const Frame*>> by_step;
  for (const Frame& frame : scene.train)
    if (!frame.depth_path.empty()) by_step[frame.step].push_back(&frame);
  std::vector<const Frame*> best;
  for (const auto& [step, frames] : by_step)
    if (frames.size() > best.size()) best = frames;
  return best;
}

}  // namespace

bool has_metric_depth(const Scene& scene, const SceneOptions& options) {
  return std::any_of(scene.train.begin(), scene.train.end(),
                     [&](const Frame& frame) { return has_true_depth(frame, options); });
}

PointCloud depth_points(const Scene& scene, FrameStore& frames, const SceneOptions& options,
                        size_t count, uint32_t seed) {
  constexpr size_t tries = 4;  // per point
  PointCloud points;
  if (options.depth != DepthFiles::metric) return points;
  const std::vector<const Frame*> views = frames_at_best_step(scene);
  for (size_t v = 0; v < views.size(); ++v) {
    const Frame& frame = *views[v];
    const Camera& camera = frames.camera(frame);
    const std::vector<float> depth = read_depth_map(frame, scene.cameras[size_t(frame.camera)],
                                                    camera.width, camera.height, options);
    const auto image = frames.rgb(frame), counted = frames.counted(frame);
    const size_t most = count * (v + 1) / views.size();  // points after this view
    const Eigen::Matrix3d turn = camera.viewmat.topLeftCorner<3, 3>().transpose();
    for (size_t k = 0; k < tries * (count / views.size() + 1) && points.size() < most; ++k) {
      const uint n = uint(k * views.size() + v);
      const int x = int(random_uniform(seed, streams::kStereoColumn, n) * float(camera.width));
      const int y = int(random_uniform(seed, streams::kStereoRow, n) * float(camera.height));
      const size_t i = size_t(y) * size_t(camera.width) + size_t(x);
      const double z = double(depth[i]);
      if (!(z > 0 && z < farthest_point) || (counted && !counted->pixels[i])) continue;
      const Eigen::Vector3d p((x + 0.5 - camera.cx) / camera.fx * z,
                              (y + 0.5 - camera.cy) / camera.fy * z, z);
      const Eigen::Vector3d world = camera.position() + turn * p;
      points.xyz.insert(points.xyz.end(), {world.x(), world.y(), world.z()});
      points.rgb.insert(points.rgb.end(), &image->pixels[3 * i], &image->pixels[3 * i] + 3);
    }
  }
  return points;
}

}  // namespace gflow
