// SPDX-License-Identifier: Apache-2.0
#include "optim/init/init.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "optim/init/dynamic_seeds.hpp"
#include "optim/loss/nearest_points.hpp"
#include "optim/motion/bases.hpp"
#include "optim/options/scene_defaults.hpp"
#include "shared/random.h"
#include "shared/sh.h"

namespace gflow {
namespace {

// Coefficients per colour channel above degree 0.
size_t rest_coefficients(int sh_degree) { return size_t((sh_degree + 1) * (sh_degree + 1) - 1); }

// Views that decide whether a point is on the object at a time.
constexpr size_t kViewsAtATime = 12;

// A training frame and the part of it that shows the object.
struct ObjectView {
  const Frame* frame;
  Rect part;
};

// Whether the point is on the object in at least nine of ten images that have it in view.
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

// Whether the point is on the object's hull, if the object moves little: two thirds of the views
// that have it in view show something other than the background there, and at least half of all
// views have it in view.
bool in_hull(FrameStore& frames, const std::vector<ObjectView>& views,
             const Eigen::Vector3d& point) {
  const std::array<uint8_t, 3> background = frames.background();
  size_t seen = 0, inside = 0;
  for (const ObjectView& view : views) {
    const Camera& camera = frames.camera(*view.frame);
    if ((camera.viewmat * point.homogeneous()).z() <= 0) continue;
    const Eigen::Vector2d at = camera.project(point);
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < camera.width && at.y() < camera.height)) continue;
    const auto image = frames.rgb(*view.frame);
    const size_t pixel = size_t(at.y()) * size_t(image->width) + size_t(at.x());
    ++seen;
    inside += differs(&image->pixels[3 * pixel], background.data());
  }
  return 2 * seen >= views.size() && 3 * inside >= 2 * seen;
}

// Training frames in order of time.
std::vector<ObjectView> views_by_time(const Scene& scene, const std::vector<Rect>& parts) {
  std::vector<ObjectView> views;
  for (size_t i = 0; i < scene.train.size(); ++i) views.push_back({&scene.train[i], parts[i]});
  std::stable_sort(views.begin(), views.end(), [](const ObjectView& a, const ObjectView& b) {
    return a.frame->time < b.frame->time;
  });
  return views;
}

// At most kViewsAtATime views nearest to a relative place in the order of time, 0 to 1.
std::vector<ObjectView> views_near(const std::vector<ObjectView>& by_time, double place) {
  const size_t count = std::min(by_time.size(), kViewsAtATime);
  const size_t first = size_t(place * double(by_time.size() - count) + 0.5);
  return {by_time.begin() + long(first), by_time.begin() + long(first + count)};
}

// At most 40 views, spread over time.
std::vector<ObjectView> some_of(const std::vector<ObjectView>& by_time) {
  std::vector<ObjectView> views;
  const size_t stride = (by_time.size() + 39) / 40;
  for (size_t i = 0; i < by_time.size(); i += stride) views.push_back(by_time[i]);
  return views;
}

// Points, each with a time in [0, 1] at which it is on the object.
struct FirstPoints {
  std::vector<float> xyz;    // [n, 3] world
  std::vector<uint8_t> rgb;  // [n, 3] or empty
  std::vector<float> time;
  size_t size() const { return xyz.size() / 3; }
};

template <class Points>
void append(Points& points, const PointCloud& from, size_t i) {
  points.xyz.insert(points.xyz.end(), &from.xyz[3 * i], &from.xyz[3 * i] + 3);
  if (!from.rgb.empty())
    points.rgb.insert(points.rgb.end(), &from.rgb[3 * i], &from.rgb[3 * i] + 3);
}

// At most `most` scene points on the object, evenly chosen.
FirstPoints fitting_points(const Scene& scene, FrameStore& frames,
                           const std::vector<ObjectView>& by_time, size_t most) {
  PointCloud kept = scene.points;
  if (scene.has_alpha) {
    const std::vector<ObjectView> views = some_of(by_time);
    kept = {};
    for (size_t i = 0; i < scene.points.size(); ++i) {
      const double* p = &scene.points.xyz[3 * i];
      if (on_object(frames, views, {p[0], p[1], p[2]})) append(kept, scene.points, i);
    }
  }
  FirstPoints points;
  const size_t count = std::min(kept.size(), most);
  for (size_t k = 0; k < count; ++k) append(points, kept, k * kept.size() / count);
  points.time.assign(count, 0.5f);
  return points;
}

// Random points in a box; with `hull` only those on the object by the images' alpha. Objects move,
// so a point needs to be on the object at its own time only.
FirstPoints random_points(const Scene& scene, FrameStore& frames,
                          const std::vector<ObjectView>& by_time, bool hull,
                          const TrainOptions& config) {
  const size_t count = size_t(std::min(config.init.count, config.density.cap));
  const uint seed = uint(config.train.seed);
  const Eigen::Vector3d centre = focus_point(scene);
  const double half = 0.5 * config.init.box * scene.extent;
  const bool one_pose =
      is_permanent(motion_model(scene, config));  // the pose in the middle of the video
  FirstPoints points;
  const uint tries = uint(std::min<size_t>(100 * count, 4000000));
  for (uint i = 0; i < tries && points.size() < count; ++i) {
    Eigen::Vector3d p;
    for (uint axis = 0; axis < 3; ++axis)
      p[axis] = centre[axis] + half * (2 * random_uniform(seed, streams::kPosition + axis, i) - 1);
    const float place = hull && !one_pose ? random_uniform(seed, streams::kTime, i) : 0.5f;
    const std::vector<ObjectView> views = views_near(by_time, place);
    if (hull && !(one_pose ? in_hull(frames, views, p) : on_object(frames, views, p))) continue;
    points.time.push_back(float(views[views.size() / 2].frame->time));
    for (uint axis = 0; axis < 3; ++axis) {
      points.xyz.push_back(float(p[axis]));
      points.rgb.push_back(uint8_t(255 * random_uniform(seed, streams::kColor + axis, i)));
    }
  }
  if (points.size() == 0)
    throw Error(fmt::format(
        "no random point of scene '{}' is on the object in nine of ten images: check its "
        "cameras and masks, or add points3D.ply",
        scene.name));
  return points;
}

// The points that init.from asks for.
FirstPoints first_points(const Scene& scene, FrameStore& frames, const std::vector<Rect>& parts,
                         const TrainOptions& config) {
  const InitFrom from = config.init.from;
  const std::vector<ObjectView> by_time = views_by_time(scene, parts);
  const bool given = from == InitFrom::points || from == InitFrom::depth ||
                     from == InitFrom::stereo || from == InitFrom::automatic;
  require_first_points(scene, config.init);
  FirstPoints points;
  if (given && scene.points.size() > 0)
    points = fitting_points(scene, frames, by_time, size_t(config.density.cap));
  // Without points, or if few of many are on the object and so are not surface points.
  const size_t enough = std::min({size_t(1000), scene.points.size(), size_t(config.density.cap)});
  if (points.size() == 0 || points.size() < enough)
    points =
        random_points(scene, frames, by_time, scene.has_alpha && from != InitFrom::random, config);
  return points;
}

// A model without Gaussians and without the groups that only its motion model has.
HostModel empty_model(const Scene& scene, const TrainOptions& config) {
  HostModel model;
  model.shape = model_shape(scene, config);
  for (const char* name :
       {"means", "means_t", "quats", "log_scales", "logit_opacities", "sh0", "sh_rest"})
    model.groups[name];
  return model;
}

// Appends an isotropic Gaussian with the initial opacity; time and scale_t in model time; rgb may
// be null.
void append_ball(HostModel& model, const float* xyz, float scale, float time, float scale_t,
                 const uint8_t* rgb, const TrainOptions& config) {
  HostGroups& g = model.groups;
  const auto append = [&](const char* name, std::initializer_list<float> values) {
    g[name].insert(g[name].end(), values);
  };
  append("means", {xyz[0], xyz[1], xyz[2]});
  append("means_t", {time});
  append("quats", {1, 0, 0, 0});
  append("log_scales", {std::log(scale), std::log(scale), std::log(scale), std::log(scale_t)});
  append("logit_opacities", {std::log(config.init.opacity / (1 - config.init.opacity))});
  for (size_t c = 0; c < 3; ++c) append("sh0", {rgb ? (float(rgb[c]) / 255 - 0.5f) / SH_C0 : 0.f});
  g["sh_rest"].resize(g["sh_rest"].size() + 3 * rest_coefficients(config.motion.sh_degree));
  ++model.count;
}

// At most `most` seeds, evenly chosen.
Seeds at_most(const Seeds& all, size_t most) {
  if (all.size() <= most) return all;
  Seeds some;
  const auto append = [](auto& to, const auto& from, size_t width, size_t i) {
    to.insert(to.end(), from.begin() + long(width * i), from.begin() + long(width * (i + 1)));
  };
  for (size_t k = 0; k < most; ++k) {
    const size_t i = k * all.size() / most;
    append(some.xyz, all.xyz, 3, i);
    append(some.rgb, all.rgb, 3, i);
    append(some.velocity, all.velocity, 3, i);
    append(some.time, all.time, 1, i);
    append(some.spacing, all.spacing, 1, i);
  }
  return some;
}

HostModel read_init_file(const TrainOptions& config) {
  const std::string& path = config.init.file;
  if (path.empty()) throw Error("init.from is \"file\", but init.file is empty");
  const HostModel file = [&] {
    try {
      return read_model(path, config.init.strict ? Undrawable::refused : Undrawable::left_out);
    } catch (const Error& problem) {
      throw Error(fmt::format("init.file: {}", problem.what()));
    }
  }();
  if (!is_static_model(file))
    throw Error(
        fmt::format("init.file {} has motion, but initial Gaussians must be static: export one "
                    "time with `gflow export --format ply --times T`",
                    path));
  if (file.count == 0) throw Error("init.file " + path + " has no Gaussians");
  if (config.density.cap > 0 && file.count > size_t(config.density.cap))
    throw Error(
        fmt::format("init.file {} has {} Gaussians, more than density.cap = {}: raise it, for "
                    "example --set density.cap={}",
                    path, file.count, config.density.cap, file.count));
  return file;
}

// Takes the Gaussians of init.file, moved to the model's origin. Bands of colour that the model
// lacks are dropped, those that the file lacks are 0.
void append_file(HostModel& model, float time, float scale_t, const TrainOptions& config) {
  const HostModel file = read_init_file(config);
  HostGroups& g = model.groups;
  for (const char* name : {"means", "quats", "log_scales", "logit_opacities", "sh0"})
    g[name] = file.groups.at(name);
  for (size_t i = 0; i < 3 * file.count; ++i) {
    const double apart = file.shape.origin[i % 3] - model.shape.origin[i % 3];
    g["means"][i] = float(double(g["means"][i]) + apart);
  }
  g["means_t"].assign(file.count, time);
  for (size_t i = 0; i < file.count; ++i) g["log_scales"][4 * i + 3] = std::log(scale_t);
  const size_t from = 3 * rest_coefficients(file.shape.sh_degree);
  const size_t to = 3 * rest_coefficients(config.motion.sh_degree);
  g["sh_rest"].assign(to * file.count, 0.f);
  for (size_t i = 0; i < file.count; ++i)
    std::copy_n(file.groups.at("sh_rest").begin() + long(from * i), std::min(from, to),
                g["sh_rest"].begin() + long(to * i));
  model.count = file.count;
}

}  // namespace

std::vector<float> neighbour_distance(const std::vector<float>& xyz) {
  const size_t n = xyz.size() / 3;
  NearestPoints tree(xyz);
  std::vector<float> distance(n);
  for (size_t i = 0; i < n; ++i) {
    const std::vector<NearestPoints::Near>& near = tree.of(&xyz[3 * i], 4);
    double sum = 0;
    for (size_t k = 1; k < near.size(); ++k) sum += std::sqrt(double(near[k].squared));
    distance[i] = float(near.size() > 1 ? sum / double(near.size() - 1) : 0);
  }
  // coincident points get the smallest distance above 0
  float least = std::numeric_limits<float>::max();
  for (const float d : distance)
    if (d > 0) least = std::min(least, d);
  if (least == std::numeric_limits<float>::max()) least = 1e-2f;
  for (float& d : distance) d = std::max(d, least);
  return distance;
}

MotionModelKind motion_model(const Scene& scene, const TrainOptions& config) {
  const MotionChoice choice = config.motion.model;
  if (choice != MotionChoice::automatic)
    return MotionModelKind(int(choice) - int(choice_of(MotionModelKind{})));
  if (begins_with_background(scene, config)) return MotionModelKind::keyframes;
  const bool alone = scene.steps > 1 && scene.train.size() < 2 * size_t(scene.steps);
  return alone ? MotionModelKind::nodes : MotionModelKind::spacetime;
}

ModelShape model_shape(const Scene& scene, const TrainOptions& config) {
  ModelShape shape;
  static_cast<MotionShape&>(shape) =
      motion_shape(motion_model(scene, config), config.motion, scene.steps);
  shape.sh_degree = config.motion.sh_degree;
  shape.origin = scene.origin;
  shape.duration = float(config.motion.duration * scene.extent);
  return shape;
}

void require_init_file(const TrainOptions& config) {
  if (config.init.begins_from_file()) read_init_file(config);
}

void require_first_points(const Scene& scene, const InitOptions& init) {
  if (init.from == InitFrom::points && scene.points.size() == 0)
    throw Error("init.from is \"points\", but scene '" + scene.name +
                "' has no points (points3D.ply or a COLMAP model in sparse/)");
  if (init.from == InitFrom::visual_hull && !scene.has_alpha)
    throw Error("init.from is \"visual-hull\", but the images of scene '" + scene.name +
                "' have no alpha or masks that show the object");
}

HostModel initial_model(const Scene& scene, FrameStore& frames, const std::vector<Rect>& parts,
                        const std::vector<StaticCamera>& static_cameras,
                        const std::vector<FlowPair>& pairs, FlowStore& flows,
                        const TrainOptions& options) {
  const TrainOptions config = with_scene_defaults(options, scene);
  HostModel model = empty_model(scene, config);
  Seeds seeds;  // none for permanent Gaussians: seeds are short-lived
  if (!config.train.sequential && !is_permanent(model.shape.motion))
    seeds = at_most(dynamic_seeds(scene, frames, static_cameras, pairs, flows, config),
                    size_t(config.density.cap) / 2);
  const float duration = model.shape.duration;
  const bool permanent = is_permanent(model.shape.motion);
  const bool lasting = permanent || scene.steps < 2 || config.train.sequential;
  const float lifetime = lasting ? 1000 * duration : config.init.lifetime * duration;
  const float short_life = config.init.dynamic_lifetime * duration / float(scene.steps);
  if (config.init.begins_from_file()) {
    append_file(model, duration / 2, lifetime, config);
    seeds = at_most(seeds, size_t(config.density.cap) - model.count);
  } else {
    TrainOptions beside_seeds = config;
    beside_seeds.density.cap -= int(seeds.size());
    const FirstPoints points = first_points(scene, frames, parts, beside_seeds);
    const std::vector<float> distance = neighbour_distance(points.xyz);
    for (size_t i = 0; i < points.size(); ++i)
      append_ball(model, &points.xyz[3 * i], distance[i],
                  (permanent ? 0.5f : points.time[i]) * duration, lifetime,
                  points.rgb.empty() ? nullptr : &points.rgb[3 * i], config);
  }
  const size_t n = model.count;
  enclose(model.shape, model.groups["means"], config.motion);
  for (size_t k = 0; k < seeds.size(); ++k)
    append_ball(model, &seeds.xyz[3 * k], seeds.spacing[k], seeds.time[k] * duration, short_life,
                &seeds.rgb[3 * k], config);
  set_static(model.shape, model.groups, model.count, uint32_t(config.train.seed));
  if (const auto place = motion_model_of(model.shape.motion).place)
    place(model.shape, model.groups, seeds.size() ? n : 0, model.count);
  for (size_t k = 0; k < seeds.size(); ++k) {
    const float* v = &seeds.velocity[3 * k];
    set_velocity(model.shape, model.groups, n + k,
                 {v[0] / duration, v[1] / duration, v[2] / duration}, seeds.spacing[k], short_life);
  }
  return model;
}

}  // namespace gflow
