// SPDX-License-Identifier: Apache-2.0
#include "optim/train/init.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>

#include "optim/motion/hexplane.hpp"
#include "optim/train/dynamic_seeds.hpp"
#include "shared/random.h"
#include "shared/sh.h"

namespace gflow {
namespace {

// Streams of random numbers, so that no two uses share one.
enum Stream : uint { kPosition = 100, kColor = 110, kTime = 120 };

// What is known of the object at a time of the video.
constexpr size_t kViewsAtATime = 12;

struct PointAdaptor {
  const std::vector<float>& xyz;
  size_t kdtree_get_point_count() const { return xyz.size() / 3; }
  float kdtree_get_pt(size_t i, size_t dim) const { return xyz[3 * i + dim]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointAdaptor>,
                                                 PointAdaptor, 3, size_t>;

// The point nearest to all viewing rays, or one `extent` ahead of a single direction.
Eigen::Vector3d looked_at(const Scene& scene) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  Eigen::Vector3d position = Eigen::Vector3d::Zero(), ahead = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train) {
    const Camera& camera = scene.cameras[size_t(frame.camera)];
    const Eigen::Vector3d axis = camera.viewmat.block<1, 3>(2, 0).transpose();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across;
    b += across * camera.position();
    position += camera.position();
    ahead += axis;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(a);
  const double n = double(std::max<size_t>(scene.train.size(), 1));
  if (solver.eigenvalues()[0] < 1e-3 * n) return position / n + ahead.normalized() * scene.extent;
  return a.ldlt().solve(b);
}

// A training frame and the part of it that shows the object.
struct ObjectView {
  const Frame* frame;
  Rect part;
};

// Whether at least nine of ten pictures that have the point in view see it on the object.
bool on_object(FrameStore& frames, const std::vector<ObjectView>& views,
               const Eigen::Vector3d& point) {
  size_t seen = 0, inside = 0;
  for (const ObjectView& view : views) {
    const Camera& camera = frames.camera(*view.frame);
    if ((camera.viewmat * point.homogeneous()).z() <= 0) continue;
    const Eigen::Vector2d at = camera.project(point);
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < camera.width && at.y() < camera.height)) continue;
    const auto alpha = frames.alpha(*view.frame);
    if (!alpha) return true;
    ++seen;
    const int x = int(at.x()) - view.part.x, y = int(at.y()) - view.part.y;
    inside += x >= 0 && y >= 0 && x < view.part.width && y < view.part.height &&
              alpha->pixels[size_t(at.y()) * size_t(alpha->width) + size_t(at.x())] > 127;
  }
  return seen > 0 && 10 * inside >= 9 * seen;
}

// Whether two thirds of the views show something other than the background at the point, and at
// least half of them have it in their picture: the object's hull while it moves little.
bool in_hull(FrameStore& frames, const std::vector<ObjectView>& views,
             const Eigen::Vector3d& point) {
  const std::array<uint8_t, 3> background = frames.background();
  size_t seen = 0, inside = 0;
  for (const ObjectView& view : views) {
    const Camera& camera = frames.camera(*view.frame);
    if ((camera.viewmat * point.homogeneous()).z() <= 0) continue;
    const Eigen::Vector2d at = camera.project(point);
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < camera.width && at.y() < camera.height)) continue;
    const auto picture = frames.rgb(*view.frame);
    const size_t pixel = size_t(at.y()) * size_t(picture->width) + size_t(at.x());
    ++seen;
    inside += differs(&picture->pixels[3 * pixel], background.data());
  }
  return 2 * seen >= views.size() && 3 * inside >= 2 * seen;
}

// The training frames by time.
std::vector<ObjectView> views_by_time(const Scene& scene, const std::vector<Rect>& parts) {
  std::vector<ObjectView> views;
  for (size_t i = 0; i < scene.train.size(); ++i) views.push_back({&scene.train[i], parts[i]});
  std::stable_sort(views.begin(), views.end(), [](const ObjectView& a, const ObjectView& b) {
    return a.frame->time < b.frame->time;
  });
  return views;
}

// The at most kViewsAtATime views nearest to a place in the order of time, 0 to 1.
std::vector<ObjectView> views_near(const std::vector<ObjectView>& by_time, double place) {
  const size_t count = std::min(by_time.size(), kViewsAtATime);
  const size_t first = size_t(place * double(by_time.size() - count) + 0.5);
  return {by_time.begin() + long(first), by_time.begin() + long(first + count)};
}

// At most 40 of them, spread over time.
std::vector<ObjectView> some_of(const std::vector<ObjectView>& by_time) {
  std::vector<ObjectView> views;
  const size_t stride = (by_time.size() + 39) / 40;
  for (size_t i = 0; i < by_time.size(); i += stride) views.push_back(by_time[i]);
  return views;
}

// Points and the time at which each is known to be on the object, in [0, 1].
struct FirstPoints : PointCloud {
  std::vector<float> time;
};

void append(PointCloud& points, const PointCloud& from, size_t i) {
  points.xyz.insert(points.xyz.end(), &from.xyz[3 * i], &from.xyz[3 * i] + 3);
  if (!from.rgb.empty())
    points.rgb.insert(points.rgb.end(), &from.rgb[3 * i], &from.rgb[3 * i] + 3);
}

// The points that lie on the object, at most `most` of them, evenly chosen.
FirstPoints fitting_points(const Scene& scene, FrameStore& frames,
                           const std::vector<ObjectView>& by_time, size_t most) {
  PointCloud kept = scene.points;
  if (scene.has_alpha) {
    const std::vector<ObjectView> views = some_of(by_time);
    kept = {};
    for (size_t i = 0; i < scene.points.size(); ++i) {
      const float* p = &scene.points.xyz[3 * i];
      if (on_object(frames, views, {p[0], p[1], p[2]})) append(kept, scene.points, i);
    }
  }
  FirstPoints points;
  const size_t count = std::min(kept.size(), most);
  for (size_t k = 0; k < count; ++k) append(points, kept, k * kept.size() / count);
  points.time.assign(count, 0.5f);
  return points;
}

// Objects move: a point of an object needs to lie on it at its own time only.
FirstPoints random_points(const Scene& scene, FrameStore& frames,
                          const std::vector<ObjectView>& by_time, const TrainConfig& config) {
  const size_t count = size_t(std::min(config.init.count, config.density.cap));
  const uint seed = uint(config.train.seed);
  const Eigen::Vector3d centre = looked_at(scene);
  const double half = 0.5 * config.init.box * scene.extent;
  const bool hull = scene.has_alpha && is_permanent(config.motion.model);  // at one time
  FirstPoints points;
  const uint tries = uint(std::min<size_t>(100 * count, 4000000));
  for (uint i = 0; i < tries && points.size() < count; ++i) {
    Eigen::Vector3d p;
    for (uint axis = 0; axis < 3; ++axis)
      p[axis] = centre[axis] + half * (2 * random_uniform(seed, kPosition + axis, i) - 1);
    const float place = scene.has_alpha && !hull ? random_uniform(seed, kTime, i) : 0.5f;
    const std::vector<ObjectView> views = views_near(by_time, place);
    if (hull ? !in_hull(frames, views, p) : scene.has_alpha && !on_object(frames, views, p))
      continue;
    points.time.push_back(float(views[views.size() / 2].frame->time));
    for (uint axis = 0; axis < 3; ++axis) {
      points.xyz.push_back(float(p[axis]));
      points.rgb.push_back(uint8_t(255 * random_uniform(seed, kColor + axis, i)));
    }
  }
  if (points.size() == 0)
    throw Error(
        fmt::format("no random point of scene {} lies on the object in nine of ten "
                    "pictures: check its cameras and masks, or give it points3D.ply",
                    scene.name));
  return points;
}

HexplaneShape hexplane_shape(const HexplaneConfig& config, int steps,
                             const std::vector<float>& xyz) {
  HexplaneShape shape;
  shape.levels = config.levels;
  shape.channels = config.channels;
  shape.resolution = config.resolution;
  shape.times = config.times > 0 ? config.times : std::max((steps + 1) / 2, 1);
  shape.hidden = config.hidden;
  shape.layers = config.layers;
  shape.turn = config.turn;
  shape.resize = config.resize;
  set_box(shape, xyz, config.slack);
  return shape;
}

}  // namespace

std::vector<float> neighbour_distance(const std::vector<float>& xyz) {
  const size_t n = xyz.size() / 3;
  const PointAdaptor adaptor{xyz};
  const Tree tree(3, adaptor);
  std::vector<float> distance(n);
  for (size_t i = 0; i < n; ++i) {
    size_t index[4];
    float squared[4];
    const size_t found = tree.knnSearch(&xyz[3 * i], 4, index, squared);
    double sum = 0;
    for (size_t k = 1; k < found; ++k) sum += std::sqrt(double(squared[k]));
    distance[i] = float(found > 1 ? sum / double(found - 1) : 0);
  }
  // coincident points get the smallest distance there is
  float least = std::numeric_limits<float>::max();
  for (const float d : distance)
    if (d > 0) least = std::min(least, d);
  if (least == std::numeric_limits<float>::max()) least = 1e-2f;
  for (float& d : distance) d = std::max(d, least);
  return distance;
}

HostModel initial_model(const Scene& scene, FrameStore& frames, const std::vector<Rect>& parts,
                        const std::vector<Watcher>& watchers, const std::vector<FlowPair>& pairs,
                        FlowStore& flows, const TrainConfig& config) {
  const bool has_points = scene.points.size() > 0;
  if (config.init.from == InitFrom::points && !has_points)
    throw Error("init.from is \"points\", but scene " + scene.name +
                " has none (points3D.ply or sparse/0/points3D.bin)");
  const std::vector<ObjectView> by_time = views_by_time(scene, parts);
  FirstPoints points;
  if (has_points && config.init.from != InitFrom::random)
    points = fitting_points(scene, frames, by_time, size_t(config.density.cap));
  // None given, or few of many on the object: those were no surface points.
  const size_t enough = std::min({size_t(1000), scene.points.size(), size_t(config.density.cap)});
  if (points.size() == 0 || points.size() < enough)
    points = random_points(scene, frames, by_time, config);
  const bool permanent = is_permanent(config.motion.model);
  Seeds seeds;
  if (!permanent) seeds = dynamic_seeds(scene, frames, watchers, pairs, flows, config);
  const size_t n = points.size(), all = n + seeds.size();

  HostModel model;
  model.count = all;
  model.shape.motion = config.motion.model;
  model.shape.sh_degree = config.motion.sh_degree;
  model.shape.duration = float(config.motion.duration * scene.extent);
  model.shape.cutoff = config.motion.cutoff;
  model.shape.keys = config.motion.keys > 0 ? config.motion.keys : std::max(scene.steps, 1);
  model.shape.hexplane = hexplane_shape(config.hexplane, scene.steps, points.xyz);
  const float duration = model.shape.duration;
  const float lifetime =
      scene.steps > 1 && !permanent ? config.init.lifetime * duration : 1000 * duration;
  const float short_life = config.init.dynamic_lifetime * duration / float(scene.steps);
  const size_t rest = size_t((config.motion.sh_degree + 1) * (config.motion.sh_degree + 1) - 1);
  auto& g = model.groups;
  g["means"] = points.xyz;
  g["means"].insert(g["means"].end(), seeds.xyz.begin(), seeds.xyz.end());
  g["means_t"].assign(all, duration / 2);
  g["quats"].assign(4 * all, 0.f);
  g["log_scales"].resize(4 * all);
  g["logit_opacities"].assign(all, std::log(config.init.opacity / (1 - config.init.opacity)));
  g["sh0"].assign(3 * all, 0.f);
  g["sh_rest"].assign(3 * rest * all, 0.f);
  for (size_t i = 0; i < all; ++i) g["quats"][4 * i] = 1;
  add_rest(model.shape, g, all, uint32_t(config.train.seed));
  const auto place = [&](size_t i, float scale, float scale_t, const uint8_t* rgb) {
    for (size_t k = 0; k < 3; ++k) g["log_scales"][4 * i + k] = std::log(scale);
    g["log_scales"][4 * i + 3] = std::log(scale_t);
    for (size_t c = 0; rgb && c < 3; ++c)
      g["sh0"][3 * i + c] = (float(rgb[c]) / 255 - 0.5f) / SH_C0;
  };
  const std::vector<float> distance = neighbour_distance(points.xyz);
  for (size_t i = 0; i < n; ++i) {
    place(i, distance[i], lifetime, points.rgb.empty() ? nullptr : &points.rgb[3 * i]);
    g["means_t"][i] = (permanent ? 0.5f : points.time[i]) * duration;
  }
  for (size_t k = 0; k < seeds.size(); ++k) {
    const size_t i = n + k;
    place(i, seeds.spacing[k], short_life, &seeds.rgb[3 * k]);
    g["means_t"][i] = seeds.time[k] * duration;
    const float* v = &seeds.velocity[3 * k];
    set_velocity(model.shape, g, i, {v[0] / duration, v[1] / duration, v[2] / duration},
                 seeds.spacing[k], short_life);
  }
  return model;
}

}  // namespace gflow
