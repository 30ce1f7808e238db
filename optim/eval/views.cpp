// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/views.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "runtime/base/decimal.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace {

constexpr double same_time = 1e-6;
constexpr size_t few = 4;  // cameras with fewer views have no video of their own

// A number with nothing but blanks before it, or NaN.
double number_in(const std::string& blanks_and_number) {
  const size_t first = blanks_and_number.find_first_not_of(" \t");
  const std::string text = first == std::string::npos ? "" : blanks_and_number.substr(first);
  return decimal_number(text).value_or(std::nan(""));
}

std::vector<std::string> pieces(const std::string& text, char separator) {
  std::vector<std::string> result;
  std::istringstream in(text);
  for (std::string piece; std::getline(in, piece, separator);) result.push_back(piece);
  return result;
}

// Time between two time steps of the scene; 0 if there is one.
double interval_of(const Scene& scene) {
  const std::vector<double> times = step_times(scene);
  return times.size() > 1 ? (times.back() - times[0]) / double(times.size() - 1) : 0;
}

// The frame of a camera at a time, in any split, or null.
const Frame* frame_at(const Scene& scene, const std::string& camera, double time) {
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split)
      if (scene.cameras[size_t(frame.camera)].name == camera &&
          std::fabs(frame.time - time) < same_time)
        return &frame;
  return nullptr;
}

// Estimated flow includes the camera's motion to the next frame; true flow is that of a static
// camera.
void set_flow_target(RenderView& view, const Frame& frame, const Frame* next,
                     const std::vector<Camera>& cameras, double interval) {
  const bool truth = !frame.flow_path.empty();
  if (truth)
    view.time_t2 = frame.flow_time;
  else if (next)
    view.time_t2 = next->time;
  else if (interval > 0 && frame.time + interval <= 1 + same_time)
    view.time_t2 = frame.time + interval;
  view.camera_t2 = cameras[size_t(next && !truth ? next->camera : frame.camera)];
  const bool shows_it = next && std::fabs(next->time - view.time_t2) < same_time;
  if (shows_it && (!truth || next->camera == frame.camera)) view.truth_t2 = next;
}

// The quantile of values at `share`.
double quantile(std::vector<float> values, double share) {
  const auto at = values.begin() + long(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return double(*at);
}

Eigen::Vector3d axis_named(const std::string& name) {
  const bool minus = name.size() == 2 && name[0] == '-';
  const std::string letter = minus ? name.substr(1) : name;
  if (letter != "x" && letter != "y" && letter != "z")
    throw Error("unknown axis '" + name + "': choose x, y, z, -x, -y or -z");
  return Eigen::Vector3d::Unit(letter[0] - 'x') * (minus ? -1 : 1);
}

// World-to-camera matrix of a camera at `position` that looks at `target`, with `up` up in the
// image.
Eigen::Matrix4d looking(const Eigen::Vector3d& position, const Eigen::Vector3d& target,
                        const Eigen::Vector3d& up) {
  const Eigen::Vector3d ahead = (target - position).normalized();
  const Eigen::Vector3d right = ahead.cross(up).normalized();
  Eigen::Matrix4d viewmat = Eigen::Matrix4d::Identity();
  viewmat.block<1, 3>(0, 0) = right.transpose();
  viewmat.block<1, 3>(1, 0) = ahead.cross(right).transpose();  // down
  viewmat.block<1, 3>(2, 0) = ahead.transpose();
  viewmat.topRightCorner<3, 1>() = -viewmat.topLeftCorner<3, 3>() * position;
  return viewmat;
}

// The median depth of the Gaussians in some of the views; 1 if none is in view.
double usual_depth(const std::vector<RenderView>& views, const HostModel& model) {
  constexpr size_t enough = 20;
  const std::vector<float>& means = model.groups.at("means");
  std::vector<float> depths;
  for (size_t k = 0; k < views.size(); k += 1 + views.size() / enough)
    for (size_t i = 0; i < model.count; ++i) {
      const Eigen::Vector3d mean = Eigen::Map<const Eigen::Vector3f>(&means[3 * i]).cast<double>();
      if (const auto depth = views[k].camera.depth_in_view(mean)) depths.push_back(float(*depth));
    }
  return depths.empty() ? 1 : quantile(std::move(depths), 0.5);
}

// The camera at `share` of the way from a to b.
Camera between(const Camera& a, const Camera& b, double share) {
  using Eigen::Quaterniond;
  const Quaterniond from(a.viewmat.topLeftCorner<3, 3>().eval());
  const Quaterniond to(b.viewmat.topLeftCorner<3, 3>().eval());
  const Eigen::Matrix3d r = from.slerp(share, to).toRotationMatrix();
  Camera camera = a;
  camera.viewmat.topLeftCorner<3, 3>() = r;
  camera.viewmat.topRightCorner<3, 1>() = -r * ((1 - share) * a.position() + share * b.position());
  return camera;
}

// Views in order of time, with more where images are held back: the usual time step apart.
std::vector<RenderView> without_gaps(const std::vector<RenderView>& views) {
  constexpr long most_missing = 100;  // in a gap, if times are irregular
  std::vector<float> steps;
  for (size_t k = 1; k < views.size(); ++k)
    steps.push_back(float(views[k].time - views[k - 1].time));
  const double step = steps.empty() ? 0 : quantile(steps, 0.5);
  std::vector<RenderView> path;
  for (size_t k = 0; k < views.size(); ++k) {
    path.push_back(views[k]);
    if (k + 1 == views.size() || step <= 0) continue;
    const double gap = views[k + 1].time - views[k].time;
    const long missing = std::lround(std::min(gap / step, double(most_missing + 1))) - 1;
    for (long j = 1; j <= missing; ++j) {
      const double share = double(j) / double(missing + 1);
      path.push_back(views[k]);
      path.back().time += share * gap;
      path.back().camera = between(views[k].camera, views[k + 1].camera, share);
    }
  }
  return path;
}

// A camera turned around the point `depth` ahead of it [radians].
Camera turned(Camera camera, double depth, double to_side, double up) {
  using Eigen::AngleAxisd, Eigen::Vector3d;
  const Eigen::Matrix3d turn =
      (AngleAxisd(to_side, Vector3d::UnitY()) * AngleAxisd(up, Vector3d::UnitX())).matrix();
  const Vector3d target(0, 0, depth);
  Eigen::Matrix4d move = Eigen::Matrix4d::Identity();
  move.topLeftCorner<3, 3>() = turn.transpose();
  move.topRightCorner<3, 1>() = target - turn.transpose() * target;
  camera.viewmat = move * camera.viewmat;
  return camera;
}

}  // namespace

std::vector<double> parse_times(const std::string& text) {
  std::vector<double> times;
  const std::vector<std::string> range = pieces(text, ':');
  if (range.size() == 3) {
    const double from = number_in(range[0]), to = number_in(range[1]), count = number_in(range[2]);
    if (count >= 1 && count <= 1e6 && count == std::floor(count))
      for (int i = 0; i < int(count); ++i)
        times.push_back(count > 1 ? from + (to - from) * i / (count - 1) : from);
  } else {
    for (const std::string& piece : pieces(text, ',')) times.push_back(number_in(piece));
  }
  const bool fine =
      std::all_of(times.begin(), times.end(), [](double t) { return t >= 0 && t <= 1; });
  if (times.empty() || !fine)
    throw Error(
        fmt::format("--times {}: expected times from 0 to 1, as 0:1:40 (40 times from 0 to 1; at "
                    "most a million) or as a list 0,0.25,1",
                    text));
  return times;
}

std::vector<double> step_times(const Scene& scene) {
  std::vector<double> times;
  for (const Frame& frame : scene.train) times.push_back(frame.time);
  std::sort(times.begin(), times.end());
  const auto same = [](double a, double b) { return b - a < same_time; };
  times.erase(std::unique(times.begin(), times.end(), same), times.end());
  return times;
}

std::vector<RenderView> split_views(const Scene& scene, const std::vector<Frame>& frames,
                                    const std::vector<Camera>& cameras, const std::string& split) {
  std::map<int, size_t> views_of_track;
  std::map<int, std::set<int>> cameras_of_track;
  for (const Frame& frame : frames) {
    ++views_of_track[frame.track];
    cameras_of_track[frame.track].insert(frame.camera);
  }
  const double interval = interval_of(scene);
  std::vector<RenderView> views;
  for (size_t i = 0; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    RenderView view;
    view.name = frame.name;
    view.camera = cameras[size_t(frame.camera)];
    const bool is_static = cameras_of_track[frame.track].size() == 1;
    view.movie =
        is_static && views_of_track[frame.track] >= few ? as_file_name(view.camera.name) : split;
    view.time = frame.time;
    view.truth = &frame;
    const bool has_next = i + 1 < frames.size() && frames[i + 1].track == frame.track &&
                          frames[i + 1].time > frame.time;
    set_flow_target(view, frame, has_next ? &frames[i + 1] : nullptr, cameras, interval);
    views.push_back(view);
  }
  if (std::all_of(views.begin(), views.end(),
                  [&](const RenderView& view) { return view.movie == split; }))
    std::stable_sort(views.begin(), views.end(),
                     [](const RenderView& a, const RenderView& b) { return a.time < b.time; });
  return views;
}

std::vector<RenderView> camera_views(const std::vector<Camera>& cameras,
                                     const std::vector<double>& times, const Scene* scene) {
  const double interval = scene && times.size() == 1 ? interval_of(*scene) : 0;
  std::vector<RenderView> views;
  std::set<std::string> names;
  for (const Camera& camera : cameras) {
    std::string name = as_file_name(camera.name);
    for (int n = 2; !names.insert(name).second; ++n)
      name = fmt::format("{}_{}", as_file_name(camera.name), n);
    for (size_t k = 0; k < times.size(); ++k) {
      RenderView view;
      view.name = times.size() > 1 ? fmt::format("{}_{:04}", name, k) : name;
      view.movie = times.size() > 1 ? name : "cameras";
      view.camera = view.camera_t2 = camera;
      view.time = times[k];
      if (k + 1 < times.size())
        view.time_t2 = times[k + 1];
      else if (interval > 0 && view.time + interval <= 1 + same_time)
        view.time_t2 = view.time + interval;
      if (scene) {
        view.truth = frame_at(*scene, camera.name, view.time);
        view.truth_t2 = frame_at(*scene, camera.name, view.time_t2);
      }
      views.push_back(view);
    }
  }
  return views;
}

std::vector<RenderView> orbit_views(const HostModel& model, const std::vector<double>& times,
                                    const std::string& up) {
  if (model.count == 0) throw Error("the model has no Gaussians to orbit around");
  const Eigen::Vector3d axis = axis_named(up);
  Eigen::Vector3d low, high;
  for (long k = 0; k < 3; ++k) {
    std::vector<float> values(model.count);
    for (size_t i = 0; i < model.count; ++i)
      values[i] = model.groups.at("means")[3 * i + size_t(k)];
    low[k] = quantile(values, 0.02);
    high[k] = quantile(values, 0.98);
  }
  const Eigen::Vector3d middle = (low + high) / 2;
  const double radius = std::max((high - low).norm() / 2, 1e-3 * (1 + middle.norm()));
  Camera camera;
  camera.name = "orbit";
  camera.width = 640;
  camera.height = 480;
  camera.cx = 320;
  camera.cy = 240;
  const double half_fov = 25 * M_PI / 180, elevation = 15 * M_PI / 180;
  camera.fx = camera.fy = 240 / std::tan(half_fov);
  const Eigen::Vector3d side = axis.unitOrthogonal(), front = axis.cross(side);
  std::vector<RenderView> views;
  for (size_t k = 0; k < times.size(); ++k) {
    const double azimuth = 2 * M_PI * double(k) / double(times.size());
    const Eigen::Vector3d from =
        std::cos(elevation) * (std::cos(azimuth) * side + std::sin(azimuth) * front) +
        std::sin(elevation) * axis;
    RenderView view;
    view.name = fmt::format("orbit_{:04}", k);
    view.movie = "orbit";
    view.camera = camera;
    view.camera.viewmat = looking(middle + from * (radius / std::sin(half_fov)), middle, axis);
    view.camera_t2 = view.camera;
    view.time = times[k];
    if (k + 1 < times.size()) view.time_t2 = times[k + 1];
    views.push_back(view);
  }
  return views;
}

std::vector<RenderView> swaying_views(const std::vector<RenderView>& views, const HostModel& model,
                                      double degrees, double per_circle) {
  std::vector<RenderView> path;
  for (const RenderView& view : views)
    if (view.movie == views[0].movie && (path.empty() || view.time >= path.back().time))
      path.push_back(view);
  const double depth = usual_depth(path, model), most = degrees * degree;
  path = without_gaps(path);
  const double circle = std::min(per_circle, double(path.size()));
  for (size_t k = 0; k < path.size(); ++k) {
    RenderView& view = path[k];
    const double at = 2 * M_PI * double(k) / circle;
    view.name = fmt::format("sway_{:04}", k);
    view.movie = "sway";
    view.camera = turned(view.camera, depth, most * std::sin(at), most / 2 * std::cos(at));
    view.camera_t2 = view.camera;
    view.time_t2 = k + 1 < path.size() ? path[k + 1].time : -1;
    view.truth = view.truth_t2 = nullptr;
  }
  return path;
}

}  // namespace gflow
