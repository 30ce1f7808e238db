// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/track_error.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "optim/flow/flow_store.hpp"
#include "optim/formats/npy.hpp"
#include "optim/model/renderer.hpp"

namespace gflow {
namespace {

// A Gaussian over one step: its pose and motion.
struct Carrier {
  Eigen::Vector3f mean, mean_later;
  Eigen::Matrix3f whiten;  // L^-1
  Eigen::Matrix3f carry;   // L' L^-1
  float opacity, reach;    // reach: three deviations along its longest axis; no effect beyond
};

using RowMatrix = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;

std::vector<Carrier> carriers(Queue& queue, Model& model, float t, float t_later) {
  GaussiansAt now, later;
  const size_t n = model.parameters.count;
  model.motion->at(queue, model.parameters, t, nullptr, now);
  const std::vector<float> opacities = now.opacities.read(queue);
  std::vector<cl_uint> alive(n);
  for (size_t i = 0; i < n; ++i) alive[i] = opacities[i] > 1.f / 255;
  const Buffer<cl_uint> seen(queue, alive, "alive");
  model.motion->at(queue, model.parameters, t_later, &seen, later);
  const std::vector<float> means = now.means.read(queue), factors = now.factors.read(queue);
  const std::vector<float> means2 = later.means.read(queue), factors2 = later.factors.read(queue);
  std::vector<Carrier> all;
  for (size_t i = 0; i < n; ++i) {
    if (!alive[i]) continue;
    const Eigen::Matrix3f l = Eigen::Map<const RowMatrix>(&factors[9 * i]);
    const Eigen::Matrix3f l2 = Eigen::Map<const RowMatrix>(&factors2[9 * i]);
    Carrier c;
    c.mean = Eigen::Map<const Eigen::Vector3f>(&means[3 * i]);
    c.mean_later = Eigen::Map<const Eigen::Vector3f>(&means2[3 * i]);
    c.whiten = l.inverse();
    c.carry = l2 * c.whiten;
    c.opacity = opacities[i];
    c.reach = 3 * l.colwise().norm().maxCoeff();
    if (c.whiten.allFinite() && c.carry.allFinite() && c.mean_later.allFinite()) all.push_back(c);
  }
  return all;
}

// Moves the point by one step; if no Gaussian carries it, it stays and the result is false.
bool carried(const std::vector<Carrier>& all, Eigen::Vector3f& point) {
  float weights = 0;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const Carrier& c : all) {
    const Eigen::Vector3f d = point - c.mean;
    if (d.squaredNorm() > c.reach * c.reach) continue;
    const float weight = c.opacity * std::exp(-0.5f * (c.whiten * d).squaredNorm());
    weights += weight;
    sum += weight * (c.mean_later + c.carry * d);
  }
  if (weights < 1e-3f) return false;
  point = sum / weights;
  return true;
}

Eigen::Vector3f point_at(const Tracks& tracks, size_t step, size_t point) {
  return Eigen::Vector3f(&tracks.xyz[3 * (step * tracks.points + point)]);
}

// Whether the true flow of an image shows the point moving between two positions.
bool sees(const Camera& camera, const TargetFlow& truth, const Eigen::Vector3f& from,
          const Eigen::Vector3f& to) {
  const auto in_camera = [&](const Eigen::Vector3f& p) -> Eigen::Vector3d {
    return (camera.viewmat * p.cast<double>().homogeneous()).head<3>();
  };
  const Eigen::Vector3d a = in_camera(from), b = in_camera(to);
  if (!(a.z() > 0 && b.z() > 0)) return false;
  const auto on_screen = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector2d(camera.fx * p.x() / p.z() + camera.cx,
                           camera.fy * p.y() / p.z() + camera.cy);
  };
  const Eigen::Vector2d at = on_screen(a), motion = on_screen(b) - at;
  for (const int i : {0, 1})
    for (const int j : {0, 1}) {
      const double x = std::floor(at.x() - 0.5) + i, y = std::floor(at.y() - 0.5) + j;
      if (!(x >= 0 && x < camera.width && y >= 0 && y < camera.height)) continue;
      const size_t pixel = size_t(y) * size_t(camera.width) + size_t(x);
      if (truth.confidence[pixel] != 255) continue;
      const Eigen::Vector2d flow(double(truth.flow.uv[2 * pixel]),
                                 double(truth.flow.uv[2 * pixel + 1]));
      if ((flow - motion).norm() < 0.3 + 0.02 * motion.norm()) return true;
    }
  return false;
}

}  // namespace

Tracks read_tracks(const std::string& path, const std::array<double, 3>& origin) {
  const Array array = read_npy(path);
  if (array.shape.size() != 3 || array.shape[0] < 2 || array.shape[1] < 1 || array.shape[2] != 3)
    throw Error(fmt::format("reading tracks {}: the shape is {}, expected (steps, points, 3)", path,
                            array.shape_text()));
  Tracks tracks{array.shape[0], array.shape[1], {}, {}};
  const std::vector<double> world = array.as_double();
  for (size_t i = 0; i < world.size(); ++i) {
    if (!std::isfinite(world[i]))
      throw Error("reading tracks " + path + ": they contain NaN or Inf");
    tracks.xyz.push_back(float(world[i] - origin[i % 3]));
  }
  return tracks;
}

void mark_seen(Tracks& tracks, const Scene& scene, const FrameStore& frames) {
  tracks.seen.clear();
  if (size_t(scene.steps) != tracks.steps) return;  // some time steps were skipped
  std::vector<uint8_t> seen((tracks.steps - 1) * tracks.points, 0), filmed(tracks.steps - 1, 0);
  for (const Frame& frame : scene.train) {
    const size_t step = size_t(frame.step);
    if (step + 1 == tracks.steps) continue;
    const double next_time = double(step + 1) / double(tracks.steps - 1);
    if (frame.flow_path.empty() || std::fabs(frame.flow_time - next_time) > 1e-6) return;
    filmed[step] = 1;
    const Camera& camera = frames.camera(frame);
    const TargetFlow target_flow = read_true_flow(frame, camera.width, camera.height);
    for (size_t k = 0; k < tracks.points; ++k)
      if (sees(camera, target_flow, point_at(tracks, step, k), point_at(tracks, step + 1, k)))
        seen[step * tracks.points + k] = 1;
  }
  if (std::find(filmed.begin(), filmed.end(), 0) == filmed.end()) tracks.seen = seen;
}

TrackError track_error(Queue& queue, Model& model, const Tracks& tracks) {
  const auto truth = [&](size_t step, size_t point) { return point_at(tracks, step, point); };
  std::vector<Eigen::Vector3f> points;
  for (size_t k = 0; k < tracks.points; ++k) points.push_back(truth(0, k));
  std::vector<double> sums(tracks.points, 0.0);
  std::vector<uint8_t> seen_so_far(tracks.points, 1);
  size_t steps_seen = 0, kept_seen = 0;  // sums over all points
  TrackError error;
  TrackError::Seen seen;
  seen.by_step.assign(tracks.steps, 0.0);
  seen.motion_by_step.assign(tracks.steps, std::nan(""));
  const double later_steps = double(tracks.steps - 1), all = later_steps * double(tracks.points);
  error.by_step.assign(tracks.steps, 0.0);
  error.motion_by_step.assign(tracks.steps, 0.0);
  error.motion_by_step[0] = std::nan("");  // no step leads to the first time step
  for (size_t step = 0; step + 1 < tracks.steps; ++step) {
    const std::vector<Carrier> now = carriers(queue, model, model.time(double(step) / later_steps),
                                              model.time(double(step + 1) / later_steps));
    size_t seen_now = 0, kept_now = 0;
    double motions = 0, distances = 0;  // over seen points
    for (size_t k = 0; k < tracks.points; ++k) {
      if (!carried(now, points[k])) error.lost += 1 / all;
      const double distance = double((points[k] - truth(step + 1, k)).norm());
      sums[k] += distance / later_steps;
      error.by_step[step + 1] += distance / double(tracks.points);
      Eigen::Vector3f restarted = truth(step, k);
      carried(now, restarted);
      const double motion = double((restarted - truth(step + 1, k)).norm());
      error.motion_by_step[step + 1] += motion / double(tracks.points);
      if (!tracks.seen.empty()) {
        const uint8_t now_seen = tracks.seen[step * tracks.points + k];
        seen_now += now_seen;
        motions += now_seen ? motion : 0;
        seen_so_far[k] &= now_seen;
        kept_now += seen_so_far[k];
        distances += seen_so_far[k] ? distance : 0;
      }
      error.still += double((truth(0, k) - truth(step + 1, k)).norm()) / all;
    }
    steps_seen += seen_now;
    kept_seen += kept_now;
    seen.motion += motions;
    seen.mean += distances;
    seen.by_step[step + 1] = kept_now ? distances / double(kept_now) : std::nan("");
    if (seen_now) seen.motion_by_step[step + 1] = motions / double(seen_now);
    error.mean += error.by_step[step + 1] / later_steps;
    error.motion += error.motion_by_step[step + 1] / later_steps;
  }
  error.end = error.by_step.back();
  if (kept_seen > 0) {
    seen.share = double(steps_seen) / all;
    seen.mean /= double(kept_seen);
    seen.motion /= double(steps_seen);
    error.seen = seen;
  }
  std::nth_element(sums.begin(), sums.begin() + long(sums.size() / 2), sums.end());
  error.median = sums[sums.size() / 2];
  return error;
}

double track_error_from_view(Queue& queue, Model& model, const Tracks& tracks, const Camera& camera,
                             float near) {
  Renderer renderer(queue, {});
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, near);
  shot.depth = true;
  renderer.forward(queue, model, shot);
  const std::vector<float> depth = renderer.images().depth.read(queue);
  const std::vector<float> alpha = renderer.images().alpha.read(queue);
  std::vector<Eigen::Vector3f> points;
  for (size_t k = 0; k < tracks.points; ++k) {
    const Eigen::Vector3d truth = point_at(tracks, 0, k).cast<double>();
    points.push_back(truth.cast<float>());
    if (!camera.depth_in_view(truth)) continue;
    const Eigen::Vector2d pixel = camera.project(truth);
    const size_t at = size_t(pixel.y()) * size_t(camera.width) + size_t(pixel.x());
    if (alpha[at] > 0.5f)
      points[k] =
          (camera.position() + double(depth[at] / alpha[at]) * camera.ray(pixel)).cast<float>();
  }
  const double steps = double(tracks.steps);
  std::vector<double> distances(tracks.points);
  for (size_t step = 0; step < tracks.steps; ++step) {
    if (step > 0) {
      const std::vector<Carrier> before =
          carriers(queue, model, model.time(double(step - 1) / (steps - 1)),
                   model.time(double(step) / (steps - 1)));
      for (Eigen::Vector3f& point : points) carried(before, point);
    }
    for (size_t k = 0; k < tracks.points; ++k)
      distances[k] += double((points[k] - point_at(tracks, step, k)).norm()) / steps;
  }
  const auto middle = distances.begin() + long(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace gflow
