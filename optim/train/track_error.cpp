// SPDX-License-Identifier: Apache-2.0
#include "optim/train/track_error.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "optim/io/npy.hpp"

namespace gflow {
namespace {

// A Gaussian over one step: where it is and how it moves.
struct Carrier {
  Eigen::Vector3f mean, mean_later;
  Eigen::Matrix3f whiten;  // L^-1
  Eigen::Matrix3f carry;   // L' L^-1
  float opacity, reach;    // reach: beyond three deviations along its longest axis it does nothing
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

// Where the point goes in the step; stays, and returns false, where nothing carries it.
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

}  // namespace

Tracks read_tracks(const std::string& path, const std::array<double, 3>& origin) {
  const Array array = read_npy(path);
  if (array.shape.size() != 3 || array.shape[0] < 2 || array.shape[1] < 1 || array.shape[2] != 3)
    throw Error(fmt::format("tracks {} have shape {}, expected is (steps, points, 3)", path,
                            array.shape_text()));
  Tracks tracks{array.shape[0], array.shape[1], {}};
  const std::vector<double> world = array.as_double();
  for (size_t i = 0; i < world.size(); ++i) {
    if (!std::isfinite(world[i]))
      throw Error("tracks " + path + " hold a value that is not finite");
    tracks.xyz.push_back(float(world[i] - origin[i % 3]));
  }
  return tracks;
}

TrackError track_error(Queue& queue, Model& model, const Tracks& tracks) {
  const auto truth = [&](size_t step, size_t point) {
    return Eigen::Vector3f(&tracks.xyz[3 * (step * tracks.points + point)]);
  };
  std::vector<Eigen::Vector3f> points;
  for (size_t k = 0; k < tracks.points; ++k) points.push_back(truth(0, k));
  std::vector<double> sums(tracks.points, 0.0);
  TrackError error;
  const double later_steps = double(tracks.steps - 1), all = later_steps * double(tracks.points);
  error.by_step.assign(tracks.steps, 0.0);
  error.motion_by_step.assign(tracks.steps, 0.0);
  for (size_t step = 0; step + 1 < tracks.steps; ++step) {
    const std::vector<Carrier> now = carriers(queue, model, model.time(double(step) / later_steps),
                                              model.time(double(step + 1) / later_steps));
    for (size_t k = 0; k < tracks.points; ++k) {
      if (!carried(now, points[k])) error.lost += 1 / all;
      const double distance = double((points[k] - truth(step + 1, k)).norm());
      sums[k] += distance / later_steps;
      error.by_step[step + 1] += distance / double(tracks.points);
      Eigen::Vector3f anew = truth(step, k);
      carried(now, anew);
      error.motion_by_step[step + 1] +=
          double((anew - truth(step + 1, k)).norm()) / double(tracks.points);
      error.still += double((truth(0, k) - truth(step + 1, k)).norm()) / all;
    }
    error.mean += error.by_step[step + 1] / later_steps;
    error.motion += error.motion_by_step[step + 1] / later_steps;
  }
  error.end = error.by_step.back();
  std::nth_element(sums.begin(), sums.begin() + long(sums.size() / 2), sums.end());
  error.median = sums[sums.size() / 2];
  return error;
}

}  // namespace gflow
