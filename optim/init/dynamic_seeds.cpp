// SPDX-License-Identifier: Apache-2.0
#include "optim/init/dynamic_seeds.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "optim/engine/random_streams.hpp"
#include "optim/init/init.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kLeastCameras = 3;
// Of many cameras that have a moving point in view, some see it before a background like it: if all
// must see change, there may be few seeds.
constexpr double kAll = 1, kMost = 0.8;

// Bounding box without the outermost 2 % of the points at each side of each axis.
std::pair<Eigen::Vector3d, Eigen::Vector3d> box_of(const std::vector<double>& xyz) {
  Eigen::Vector3d low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (size_t i = size_t(axis); i < xyz.size(); i += 3) values.push_back(xyz[i]);
    std::sort(values.begin(), values.end());
    low[axis] = values[values.size() / 50];
    high[axis] = values[values.size() - 1 - values.size() / 50];
  }
  const Eigen::Vector3d margin = 0.05 * (high - low);
  return {low - margin, high + margin};
}

// Index of a static camera's frame at a time step, or -1.
int frame_at(const StaticCamera& static_camera, int step) {
  for (size_t i = 0; i < static_camera.frames.size(); ++i)
    if (static_camera.frames[i]->step == step) return int(i);
  return -1;
}

// Pixel index at which a camera sees a point; -1 if it does not.
long pixel_of(const Camera& camera, const Eigen::Vector3d& point) {
  if ((camera.viewmat * point.homogeneous()).z() <= 0) return -1;
  const Eigen::Vector2d at = camera.project(point);
  if (!(at.x() >= 0 && at.y() >= 0 && at.x() < camera.width && at.y() < camera.height)) return -1;
  return long(at.y()) * camera.width + long(at.x());
}

// The images of all static cameras at one time step.
struct StepViews {
  std::vector<const Camera*> cameras;
  std::vector<std::shared_ptr<const Image>> images;
  std::vector<std::vector<uint8_t>> changed;
  std::vector<std::shared_ptr<const TargetFlow>> flows;  // null if there is none
  double time = 0;                                       // of the time step, in [0, 1]
  double flow_time = 0;  // time that the flow covers [lengths of the video]
  double share = kAll;   // of the cameras that must see change
};

// Whether at least kLeastCameras cameras see change at the point, which are at least views.share of
// those that have it in view; sets the mean colour.
bool inside_hull(const StepViews& views, const Eigen::Vector3d& point, std::array<int, 3>& color) {
  size_t in_view = 0, seen = 0;
  std::array<int, 3> sum{};
  const double most_unseen = (1 - views.share) * double(views.cameras.size());
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const long at = pixel_of(*views.cameras[c], point);
    if (at < 0) continue;
    ++in_view;
    if (!views.changed[c][size_t(at)]) {
      if (double(in_view - seen) > most_unseen) return false;  // early, as most candidates fail
      continue;
    }
    ++seen;
    for (size_t k = 0; k < 3; ++k) sum[k] += views.images[c]->pixels[3 * size_t(at) + k];
  }
  if (seen < kLeastCameras || double(seen) < views.share * double(in_view)) return false;
  for (size_t k = 0; k < 3; ++k) color[k] = sum[k] / int(seen);
  return true;
}

// Least squares over the cameras: J v = flow, with J the derivative of the pixel by the point. 0 if
// fewer than three cameras have confident flow, or the residual is 2 px or more.
Eigen::Vector3d velocity_at(const StepViews& views, const Eigen::Vector3d& point) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  std::vector<std::pair<Eigen::Matrix<double, 2, 3>, Eigen::Vector2d>> rows;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const long at = pixel_of(*views.cameras[c], point);
    if (at < 0 || !views.flows[c] || !views.flows[c]->confidence[size_t(at)]) continue;
    const Eigen::Matrix<double, 2, 3> j = views.cameras[c]->derivative(point);
    const std::vector<float>& uv = views.flows[c]->flow.uv;
    const Eigen::Vector2d f(uv[2 * size_t(at)], uv[2 * size_t(at) + 1]);
    a += j.transpose() * j;
    b += j.transpose() * f;
    rows.emplace_back(j, f);
  }
  if (rows.size() < kLeastCameras) return Eigen::Vector3d::Zero();
  a += 1e-3 * a.trace() / 3 * Eigen::Matrix3d::Identity();  // depth is weakly constrained
  const Eigen::Vector3d v = a.ldlt().solve(b);
  double residual = 0;
  for (const auto& [j, f] : rows) residual += (j * v - f).squaredNorm();
  if (!(std::sqrt(residual / double(rows.size())) < 2)) return Eigen::Vector3d::Zero();
  return v / views.flow_time;
}

// Index of the flow pair that starts at each frame. Cameras are static, so all flow is the scene's.
// Empty if flow is computed on demand, because all flows would be needed.
std::map<const Frame*, size_t> flow_index(const Scene& scene, const std::vector<FlowPair>& pairs,
                                          const FlowStore& flows) {
  std::map<const Frame*, size_t> index;
  if (!flows.is_precomputed()) return index;
  for (size_t i = 0; i < pairs.size(); ++i)
    if (flows.has(i) && pairs[i].next >= 0 && !is_backward_in_time(scene, pairs[i]) &&
        scene.train[size_t(pairs[i].frame)].camera == scene.train[size_t(pairs[i].next)].camera)
      index[&scene.train[size_t(pairs[i].frame)]] = i;
  return index;
}

StepViews views_at(const std::vector<StaticCamera>& static_cameras, int step, const Scene& scene,
                   FrameStore& frames, const std::vector<FlowPair>& pairs, FlowStore& flows,
                   const std::map<const Frame*, size_t>& flow_of) {
  StepViews views;
  for (const StaticCamera& static_camera : static_cameras) {
    const int k = frame_at(static_camera, step);
    if (k < 0) continue;
    const Frame* frame = static_camera.frames[size_t(k)];
    views.cameras.push_back(&static_camera.camera);
    views.images.push_back(frames.rgb(*frame));
    views.changed.push_back(changed_pixels(frames, *frame, static_camera.usual));
    views.time = frame->time;
    const auto found = flow_of.find(frame);
    views.flows.push_back(found == flow_of.end() ? nullptr : flows.get(found->second));
    if (found != flow_of.end())
      views.flow_time = scene.train[size_t(pairs[found->second].next)].time - frame->time;
  }
  return views;
}

using Box = std::pair<Eigen::Vector3d, Eigen::Vector3d>;
// The views of a time step. All steps at a time would not fit into memory.
using ViewsOfStep = std::function<StepViews(int)>;

// Where the rays of changed pixels meet: points at random on rays of all static cameras that lie in
// the visual hull, of up to kHullSteps time steps. Nothing if there are too few.
std::optional<Box> box_of_change(const Scene& scene, const ViewsOfStep& views_of, uint seed) {
  constexpr int kHullSteps = 8;
  constexpr size_t kLeastHits = 20;
  constexpr uint kTries = 40000;
  const Eigen::Vector3d middle = focus_point(scene);
  std::vector<double> hits;
  const int stride = std::max(1, scene.steps / kHullSteps);
  uint n = 0;
  const auto random = [&] { return random_uniform(seed, streams::kChangeRays, n++); };
  for (int step = 0; step < scene.steps; step += stride) {
    const StepViews views = views_of(step);
    if (views.cameras.size() < kLeastCameras) continue;
    std::vector<std::vector<size_t>> changed(views.cameras.size());
    for (size_t c = 0; c < changed.size(); ++c)
      for (size_t i = 0; i < views.changed[c].size(); ++i)
        if (views.changed[c][i]) changed[c].push_back(i);
    for (uint i = 0; i < kTries; ++i) {
      const size_t c = i % changed.size();
      if (changed[c].empty()) continue;
      const Camera& camera = *views.cameras[c];
      const size_t pixel = changed[c][size_t(random() * double(changed[c].size()))];
      const double distance = (camera.position() - middle).norm();
      const double near = scene.near > 0 ? scene.near : distance / 8;
      const double far = scene.far > near ? scene.far : distance * 8;
      const double depth = near * std::pow(far / near, double(random()));
      const double x = double(pixel % size_t(camera.width)) + 0.5,
                   y = double(pixel / size_t(camera.width)) + 0.5;
      const Eigen::Vector3d seen((x - camera.cx) / camera.fx * depth,
                                 (y - camera.cy) / camera.fy * depth, depth);
      const Eigen::Vector3d point =
          camera.position() + camera.viewmat.topLeftCorner<3, 3>().transpose() * seen;
      std::array<int, 3> color;
      if (inside_hull(views, point, color)) hits.insert(hits.end(), point.data(), point.data() + 3);
    }
  }
  if (hits.size() < 3 * kLeastHits) return std::nullopt;
  return box_of(hits);
}

// About `wanted` seeds of each time step at random places of the box.
Seeds seeds_in(const Box& box, int steps, const ViewsOfStep& views_of, size_t wanted, uint seed) {
  const auto& [low, high] = box;
  Seeds seeds;
  for (int step = 0; step < steps; ++step) {
    const StepViews views = views_of(step);
    if (views.cameras.size() < kLeastCameras) continue;
    std::vector<float> xyz;
    for (uint i = 0; i < 500000 && xyz.size() < 3 * wanted; ++i) {
      Eigen::Vector3d point;
      for (int axis = 0; axis < 3; ++axis) {
        const uint stream = streams::kDynamicSeeds + uint(3 * step + axis);
        point[axis] = low[axis] + (high[axis] - low[axis]) * random_uniform(seed, stream, i);
      }
      std::array<int, 3> color;
      if (!inside_hull(views, point, color)) continue;
      const Eigen::Vector3d v = velocity_at(views, point);
      for (int axis = 0; axis < 3; ++axis) {
        xyz.push_back(float(point[axis]));
        seeds.rgb.push_back(uint8_t(color[size_t(axis)]));
        seeds.velocity.push_back(float(v[axis]));
      }
      seeds.time.push_back(float(views.time));
    }
    const std::vector<float> spacing = neighbour_distance(xyz);
    seeds.spacing.insert(seeds.spacing.end(), spacing.begin(), spacing.end());
    seeds.xyz.insert(seeds.xyz.end(), xyz.begin(), xyz.end());
  }
  return seeds;
}

}  // namespace

Seeds dynamic_seeds(const Scene& scene, FrameStore& frames,
                    const std::vector<StaticCamera>& static_cameras,
                    const std::vector<FlowPair>& pairs, FlowStore& flows,
                    const TrainOptions& config) {
  Seeds seeds;
  if (config.init.dynamic == 0 || scene.points.size() < 50 || scene.steps < 4) return seeds;
  if (static_cameras.size() < kLeastCameras) return seeds;
  const auto flow_of = flow_index(scene, pairs, flows);
  const size_t wanted = std::max<size_t>(1, size_t(config.init.dynamic) / size_t(scene.steps));
  const uint seed = uint(config.train.seed);
  double share = kAll;
  const auto views_of = [&](int step) {
    StepViews views = views_at(static_cameras, step, scene, frames, pairs, flows, flow_of);
    views.share = share;
    return views;
  };
  seeds = seeds_in(box_of(scene.points.xyz), scene.steps, views_of, wanted, seed);
  // Points of a far background make the box so large that few candidates lie in the hull.
  if (2 * seeds.size() >= size_t(config.init.dynamic)) return seeds;
  for (const double enough : {kAll, kMost}) {
    share = enough;
    if (2 * seeds.size() >= size_t(config.init.dynamic)) break;
    if (const auto box = box_of_change(scene, views_of, seed)) {
      Seeds others = seeds_in(*box, scene.steps, views_of, wanted, seed);
      if (others.size() > seeds.size()) seeds = std::move(others);
    }
  }
  return seeds;
}

}  // namespace gflow
