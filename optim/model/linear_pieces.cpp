// SPDX-License-Identifier: Apache-2.0
#include "optim/model/linear_pieces.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "optim/formats/splat_table.hpp"
#include "optim/model/slice.hpp"

namespace gflow {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A Gaussian whose temporal weight falls by less than this over the whole video counts as
// permanent.
constexpr double kFades = 1e-3;

// Lifetime: temporal standard deviation in model time.
double life_of(const HostModel& model, size_t i) {
  if (const auto lifetime = motion_model_of(model.shape.motion).lifetime)
    return lifetime(model.groups, i);
  return std::exp(double(model.groups.at("log_scales")[4 * i + 3]));
}

struct PathSample {
  Vector3d mean;
  Eigen::Matrix3f factor;

  Matrix3d covariance() const {
    const Matrix3d l = factor.cast<double>();
    return l * l.transpose();
  }
};

double difference(const PathSample& from, const PathSample& to) {
  const Matrix3d a = from.covariance();
  return (a - to.covariance()).norm() / std::max(a.norm(), 1e-300);
}

// State of one Gaussian while samples arrive. The line starts at the first sample of the piece; its
// velocity is in [low, high], which each sample narrows. The shape is that of the last sample that
// is still similar to the first one, so it is between those of the piece.
struct Path {
  MovingSplat splat;           // common to all pieces
  size_t first = 0, last = 0;  // visible from `first` to `last`; first > last: never
  bool open = false, shaped = false;
  size_t begin = 0;              // first sample of the piece
  PathSample start, shape, now;  // now: the latest sample
  Vector3d low, high;
  double slack = 0;  // allowed distance from the line
};

class PathCutter {
 public:
  PathCutter(const HostModel& model, const PieceRule& rule) : rule_(rule) {
    length_ = std::max(rule.steps - 1, 1) / rule.fps;
    scene_.duration = rule.steps / rule.fps;
    scene_.fps = rule.fps;
    scene_.cutoff = std::max(double(model.shape.cutoff), 1e-6);
    scene_.sh_degree = model.shape.sh_degree;
    set_harmonics(model);
    const double seen = std::sqrt(-2 * std::log(scene_.cutoff));
    const double unit = length_ / double(model.shape.duration);  // [s] per unit of model time
    for (size_t i = 0; i < model.count; ++i) {
      Path path;
      MovingSplat& s = path.splat;
      s.sh_row = i;
      for (size_t k = 0; k < 3; ++k)
        s.color[k] = color_of_sh0(double(model.groups.at("sh0")[3 * i + k]));
      s.opacity = opacity_of_logit(double(model.groups.at("logit_opacities")[i]));
      s.mean_t = double(model.groups.at("means_t")[i]) * unit;
      s.life = life_of(model, i) * unit;
      const double early = (s.mean_t - seen * s.life) * rule.fps;  // [steps]
      const double late = (s.mean_t + seen * s.life) * rule.fps;
      const double steps = rule.steps - 1;
      path.first = size_t(std::clamp(std::floor(early), 0.0, steps));
      path.last = size_t(std::clamp(std::ceil(late), 0.0, steps));
      if (early > steps || late < 0) path.first = path.last + 1;
      const double furthest = std::max(std::fabs(s.mean_t), std::fabs(length_ - s.mean_t)) / s.life;
      if (furthest * furthest / 2 < kFades) s.life = std::numeric_limits<double>::infinity();
      paths_.push_back(path);
    }
  }

  // Adds sample k of all Gaussians; call in order of k.
  void add(size_t k, const std::vector<float>& means, const std::vector<float>& factors) {
    for (size_t i = 0; i < paths_.size(); ++i) {
      Path& path = paths_[i];
      if (k < path.first || k > path.last) continue;
      PathSample sample;
      sample.mean = Eigen::Map<const Eigen::Vector3f>(&means[3 * i]).cast<double>();
      sample.factor =
          Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(&factors[9 * i]);
      extend(path, sample, k);
      if (k == path.last) close(path, k, k + 1 == size_t(rule_.steps));
    }
  }

  MovingSplats take() { return std::move(scene_); }

 private:
  double time(size_t k) const { return double(k) / rule_.fps; }

  void open(Path& path, const PathSample& sample, size_t k) const {
    path.open = true;
    path.shaped = false;
    path.begin = k;
    path.start = path.shape = path.now = sample;
    path.low.setConstant(-std::numeric_limits<double>::infinity());
    path.high = -path.low;
    path.slack = rule_.shift * std::cbrt(std::fabs(sample.factor.cast<double>().determinant()));
  }

  void extend(Path& path, const PathSample& sample, size_t k) {
    if (!path.open) return open(path, sample, k);
    if (!narrow(path, sample, k)) {  // the line ends at the sample before
      const PathSample before = path.now;
      close(path, k - 1, false);
      open(path, before, k - 1);
      narrow(path, sample, k);
    }
    if (!path.shaped && difference(path.start, sample) <= rule_.shape)
      path.shape = sample;
    else
      path.shaped = true;
    path.now = sample;
    if (path.shaped && difference(path.shape, sample) > rule_.shape) {
      close(path, k, false);
      open(path, sample, k);
    }
  }

  // Returns false and changes nothing if no line from the start passes all samples.
  bool narrow(Path& path, const PathSample& sample, size_t k) const {
    const double passed = time(k) - time(path.begin);
    const Vector3d velocity = (sample.mean - path.start.mean) / passed;
    const Vector3d low = path.low.cwiseMax((velocity.array() - path.slack / passed).matrix());
    const Vector3d high = path.high.cwiseMin((velocity.array() + path.slack / passed).matrix());
    if ((low.array() > high.array()).any()) return false;
    path.low = low;
    path.high = high;
    return true;
  }

  // Emits the piece up to sample k; the last sample of the video is shown, too.
  void close(Path& path, size_t k, bool to_the_end) {
    path.open = false;
    MovingSplat s = path.splat;
    s.begin = time(path.begin);
    s.end = to_the_end ? scene_.duration : time(k);
    if (s.end <= s.begin) return;
    Vector3d velocity = Vector3d::Zero();
    if (k > path.begin)
      velocity = ((path.now.mean - path.start.mean) / (time(k) - s.begin))
                     .cwiseMax(path.low)
                     .cwiseMin(path.high);
    if (std::isinf(s.life)) s.mean_t = s.begin;
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> factor = path.shape.factor;
    const FactorParts parts = parts_of_factor(factor.data());
    s.quat = parts.quat;
    for (size_t axis = 0; axis < 3; ++axis) {
      s.scales[axis] = std::max(parts.scales[axis], double(std::numeric_limits<float>::min()));
      s.velocity[axis] = velocity[long(axis)];
      s.mean[axis] = path.start.mean[long(axis)] + s.velocity[axis] * (s.mean_t - s.begin);
    }
    scene_.splats.push_back(s);
  }

  // Reorders from coefficient-major to channel-major.
  void set_harmonics(const HostModel& model) {
    const auto rest = size_t((model.shape.sh_degree + 1) * (model.shape.sh_degree + 1) - 1);
    scene_.sh_rest.resize(3 * rest * model.count);
    for (size_t i = 0; i < model.count; ++i)
      for (size_t k = 0; k < rest; ++k)
        for (size_t c = 0; c < 3; ++c)
          scene_.sh_rest[(3 * i + c) * rest + k] =
              model.groups.at("sh_rest")[3 * (i * rest + k) + c];
  }

  PieceRule rule_;
  double length_;  // from the first sample to the last [s]
  MovingSplats scene_;
  std::vector<Path> paths_;
};

}  // namespace

MovingSplats linear_pieces(Queue& queue, Model& model, const PieceRule& rule,
                           const std::function<void()>& after_step) {
  if (rule.steps < 1 || !(rule.fps > 0))
    throw Error(
        fmt::format("splitting paths into pieces needs at least 1 step and more than 0 steps per "
                    "second, not {} and {}",
                    rule.steps, rule.fps));
  PathCutter cutter(model.read(queue), rule);
  // All Gaussians, inside their time window or not: a piece begins before its Gaussian is visible.
  const Buffer<cl_uint> all(queue, std::vector<cl_uint>(model.parameters.count, 1), "all");
  GaussiansAt at;
  for (int k = 0; k < rule.steps; ++k) {
    const double scene_time = double(k) / std::max(rule.steps - 1, 1);
    model.motion->at(queue, model.parameters, model.time(scene_time), &all, at);
    cutter.add(size_t(k), at.means.read(queue), at.factors.read(queue));
    after_step();
  }
  return cutter.take();
}

}  // namespace gflow
