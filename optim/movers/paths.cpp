// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/paths.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "optim/loss/nearest_points.hpp"

namespace gflow {
namespace {

constexpr size_t kNeighbours = 4;  // whose motion a path out of view takes on

// The pixel to which flow carries a position [px, pixel centres at .5] that stays on the mover;
// false if it does not.
bool carry(const TargetFlow& flow, const Mask& to, Eigen::Vector2d& at) {
  const int x = int(at.x()), y = int(at.y());
  const size_t i = size_t(y) * size_t(to.width) + size_t(x);
  if (!flow.confidence[i]) return false;
  at += Eigen::Vector2d(double(flow.flow.uv[2 * i]), double(flow.flow.uv[2 * i + 1]));
  return at.x() >= 0 && at.y() >= 0 && at.x() < to.width && at.y() < to.height &&
         to.at(int(at.x()), int(at.y()));
}

void set(Paths& paths, size_t i, size_t frame, const Eigen::Vector3d& place) {
  for (size_t c = 0; c < 3; ++c)
    paths.xyz[3 * (i * paths.frames() + frame) + c] = float(place[long(c)]);
}

// The path of a pixel of a mover, as far as flow leads in both directions.
void follow(const SmallVideo& video, const Mover& mover, const NeighbourFlows& flows, size_t begin,
            const Eigen::Vector2d& pixel, Paths& paths) {
  const size_t n = video.size(), i = paths.count();
  paths.xyz.resize(paths.xyz.size() + 3 * n);
  paths.seen.resize(paths.seen.size() + n);
  paths.first_seen.push_back(int(begin));
  const auto mark = [&](size_t frame, const Eigen::Vector2d& at) {
    const Camera& camera = video.cameras[frame];
    set(paths, i, frame, camera.position() + mover.depths[frame] * camera.ray(at));
    paths.seen[i * n + frame] = 1;
  };
  mark(begin, pixel);
  Eigen::Vector2d at = pixel;
  for (size_t frame = begin; frame + 1 < n; ++frame) {
    if (!(mover.depths[frame + 1] > 0) || !carry(flows[frame].first, mover.masks[frame + 1], at))
      break;
    mark(frame + 1, at);
  }
  at = pixel;
  for (size_t frame = begin; frame > 0; --frame) {
    if (!(mover.depths[frame - 1] > 0) ||
        !carry(flows[frame - 1].second, mover.masks[frame - 1], at))
      break;
    mark(frame - 1, at);
  }
}

// Continues the paths [first, end) of a mover from `frame` to `next` where they are out of view
// there but known in `frame`: by the mean motion of the nearest that are in view in both.
void extend(Paths& paths, size_t first, size_t end, size_t frame, size_t next,
            std::vector<uint8_t>& known) {
  std::vector<float> leaders, steps;
  for (size_t i = first; i < end; ++i) {
    if (!paths.is_seen(i, frame) || !paths.is_seen(i, next)) continue;
    const float *from = paths.at(i, frame), *to = paths.at(i, next);
    leaders.insert(leaders.end(), from, from + 3);
    for (size_t c = 0; c < 3; ++c) steps.push_back(to[c] - from[c]);
  }
  if (leaders.empty()) leaders = {0, 0, 0}, steps = {0, 0, 0};
  NearestPoints tree(leaders);
  for (size_t i = first; i < end; ++i) {
    uint8_t& is_known = known[i * paths.frames() + next];
    if (is_known || !known[i * paths.frames() + frame]) continue;
    is_known = 1;
    const float* from = paths.at(i, frame);
    Eigen::Vector3d to = Eigen::Vector3f(from[0], from[1], from[2]).cast<double>();
    const auto& near = tree.of(from, kNeighbours);
    for (const NearestPoints::Near& one : near)
      for (size_t c = 0; c < 3; ++c)
        to[long(c)] += double(steps[3 * one.index + c]) / double(near.size());
    set(paths, i, next, to);
  }
}

}  // namespace

Paths paths_of(const SmallVideo& video, const std::vector<Mover>& movers,
               const NeighbourFlows& flows, size_t wanted) {
  const size_t n = video.size();
  Paths paths;
  for (const Frame* frame : video.frames) paths.times.push_back(frame->time);
  std::vector<size_t> chosen;
  const size_t many = std::min(n, kChosenFrames);
  for (size_t k = 0; k < many; ++k) chosen.push_back((2 * k + 1) * n / (2 * many));
  size_t pixels = 0;
  for (const Mover& mover : movers)
    for (const size_t frame : chosen)
      pixels += size_t(
          std::accumulate(mover.masks[frame].pixels.begin(), mover.masks[frame].pixels.end(), 0));
  const double apart =
      std::max(1.0, std::sqrt(double(pixels) / double(std::max<size_t>(wanted, 1))));
  for (const Mover& mover : movers) {
    const size_t first = paths.count();
    for (const size_t frame : chosen) {
      if (!(mover.depths[frame] > 0)) continue;
      for (double y = 0.5 * apart; y < video.height(); y += apart)
        for (double x = 0.5 * apart; x < video.width(); x += apart) {
          if (!mover.masks[frame].at(int(x), int(y))) continue;
          follow(video, mover, flows, frame, {x, y}, paths);
          const size_t at = size_t(y) * size_t(video.width()) + size_t(x);
          const uint8_t* rgb = &video.images[frame].pixels[3 * at];
          paths.rgb.insert(paths.rgb.end(), rgb, rgb + 3);
          paths.size.push_back(float(apart * mover.depths[frame] / video.cameras[frame].fx));
        }
    }
    std::vector<uint8_t> known = paths.seen;
    for (size_t frame = 0; frame + 1 < n; ++frame)
      extend(paths, first, paths.count(), frame, frame + 1, known);
    for (size_t frame = n - 1; frame > 0; --frame)
      extend(paths, first, paths.count(), frame, frame - 1, known);
  }
  return paths;
}

}  // namespace gflow
