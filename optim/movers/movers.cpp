// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/movers.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "runtime/base/parallel.hpp"

namespace gflow {
namespace {

constexpr std::array<size_t, 3> kMotionSpans{1, 2, 4};  // frames over which motion is counted
constexpr double kOverlap = 0.5;      // share of a part that its flow carries into the same mover
constexpr double kLeastShare = 5e-4;  // of all pixels of the video, for a mover
constexpr size_t kMost = 16;          // movers, the largest
constexpr double kNearest = 0.05;     // share of the background's depths that may be nearer
// Weights of the least squares, relative to the motion over one frame.
constexpr double kFollowed = 0.4;  // share of the bounds
constexpr double kSmooth = 9, kBound = 0.09, kPrior = 1e-6;

// Where the flow of a pixel leads, as an index, or -1.
long carried(const TargetFlow& flow, int x, int y) {
  const int w = flow.flow.width, h = flow.flow.height;
  const size_t i = size_t(y) * size_t(w) + size_t(x);
  if (!flow.confidence[i]) return -1;
  const long to_x = std::lround(x + double(flow.flow.uv[2 * i]));
  const long to_y = std::lround(y + double(flow.flow.uv[2 * i + 1]));
  return to_x >= 0 && to_y >= 0 && to_x < w && to_y < h ? to_y * w + to_x : -1;
}

// Groups of equal things, by union of pairs.
struct Groups {
  std::vector<size_t> parents;
  size_t add() {
    parents.push_back(parents.size());
    return parents.size() - 1;
  }
  size_t root(size_t i) {
    while (parents[i] != i) i = parents[i] = parents[parents[i]];
    return i;
  }
  void join(size_t i, size_t j) { parents[root(i)] = root(j); }
};

// The parts of all frames as chains over time, without depths.
std::vector<Mover> chains_of(const SmallVideo& video, const std::vector<Mask>& moving,
                             const NeighbourFlows& flows) {
  std::vector<Parts> parts;
  std::vector<size_t> first;  // number of a frame's first part
  Groups groups;
  for (const Mask& mask : moving) {
    parts.push_back(parts_of(mask));
    first.push_back(groups.parents.size());
    for (int k = 0; k < parts.back().count; ++k) groups.add();
  }
  const int w = video.width(), h = video.height();
  const auto link = [&](size_t from, size_t to, const TargetFlow& flow) {
    const Parts &a = parts[from], &b = parts[to];
    std::vector<size_t> shared(size_t(a.count) * size_t(b.count)), tracked(size_t(a.count));
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        const int label = a.labels[size_t(y) * size_t(w) + size_t(x)];
        const long at = label > 0 ? carried(flow, x, y) : -1;
        if (at < 0) continue;
        ++tracked[size_t(label - 1)];
        if (const int other = b.labels[size_t(at)])
          ++shared[size_t(label - 1) * size_t(b.count) + size_t(other - 1)];
      }
    for (size_t i = 0; i < size_t(a.count); ++i)
      for (size_t j = 0; j < size_t(b.count); ++j)
        if (tracked[i] > 0 &&
            double(shared[i * size_t(b.count) + j]) >= kOverlap * double(tracked[i]))
          groups.join(first[from] + i, first[to] + j);
  };
  for (size_t i = 0; i + 1 < video.size(); ++i) {
    link(i, i + 1, flows[i].first);
    link(i + 1, i, flows[i].second);
  }
  std::vector<Mover> chains;
  std::vector<size_t> chain_of(groups.parents.size(), groups.parents.size());
  std::vector<size_t> sizes(groups.parents.size());
  for (size_t i = 0; i < parts.size(); ++i)
    for (size_t k = 0; k < parts[i].sizes.size(); ++k)
      sizes[groups.root(first[i] + k)] += parts[i].sizes[k];
  std::vector<size_t> by_size = sizes;
  std::sort(by_size.rbegin(), by_size.rend());
  const double least = std::max(kLeastShare * double(video.size()) * w * h,
                                by_size.size() > kMost ? double(by_size[kMost - 1]) : 0);
  for (size_t i = 0; i < parts.size(); ++i)
    for (size_t k = 0; k < parts[i].sizes.size(); ++k) {
      const size_t group = groups.root(first[i] + k);
      if (double(sizes[group]) < least) continue;
      if (chain_of[group] == groups.parents.size()) {
        chain_of[group] = chains.size();
        chains.push_back({std::vector<Mask>(video.size(), Mask(w, h)), {}});
      }
      Mask& mask = chains[chain_of[group]].masks[i];
      for (size_t pixel = 0; pixel < mask.pixels.size(); ++pixel)
        if (parts[i].labels[pixel] == int(k) + 1) mask.pixels[pixel] = 1;
    }
  return chains;
}

// The depth that the mover does not exceed: that of the nearest of what it hides.
double bound_of(const Mask& mask, const std::vector<float>& depths) {
  std::vector<float> hidden;
  for (size_t i = 0; i < depths.size(); ++i)
    if (mask.pixels[i] && std::isfinite(depths[i])) hidden.push_back(depths[i]);
  if (hidden.empty()) return 0;
  const auto near = hidden.begin() + long(kNearest * double(hidden.size()));
  std::nth_element(hidden.begin(), near, hidden.end());
  return double(*near);
}

// A mover comes near to what it hides, as feet to the ground, in some frames only, and masks are
// wrong in others: the lower quartile over neighbouring frames that have a bound.
std::vector<double> steadied(const std::vector<double>& bounds) {
  constexpr size_t reach = 7;  // frames
  std::vector<double> result(bounds.size());
  for (size_t i = 0; i < bounds.size(); ++i) {
    if (bounds[i] <= 0) continue;
    std::vector<double> near;
    for (size_t k = i - std::min(i, reach); k <= std::min(i + reach, bounds.size() - 1); ++k)
      if (bounds[k] > 0) near.push_back(bounds[k]);
    std::nth_element(near.begin(), near.begin() + long(near.size() / 4), near.end());
    result[i] = near[near.size() / 4];
  }
  return result;
}

// The mean rays [world, 1 along the axis] of the pixels that flow carries from one frame's mask to
// the other's.
struct CarriedRays {
  size_t from, to;
  Eigen::Vector3d ray, ray_to;
};

bool any(const Mask& mask) {
  return std::any_of(mask.pixels.begin(), mask.pixels.end(), [](uint8_t x) { return x; });
}

// Those of a mover between two frames; nothing if flow carries too few pixels.
std::optional<CarriedRays> rays_between(const SmallVideo& video, const Mover& mover, size_t from,
                                        size_t to, const TargetFlow& flow) {
  constexpr int least = 30;  // pixels
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), sum_to = Eigen::Vector2d::Zero();
  int count = 0;
  const int w = video.width(), h = video.height();
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const long at = mover.masks[from].at(x, y) ? carried(flow, x, y) : -1;
      if (at < 0 || !mover.masks[to].pixels[size_t(at)]) continue;
      const float* uv = &flow.flow.uv[2 * (size_t(y) * size_t(w) + size_t(x))];
      sum += Eigen::Vector2d(x + 0.5, y + 0.5);
      sum_to += Eigen::Vector2d(x + 0.5 + double(uv[0]), y + 0.5 + double(uv[1]));
      ++count;
    }
  if (count < least) return std::nullopt;
  return CarriedRays{from, to, video.cameras[from].ray(sum / count),
                     video.cameras[to].ray(sum_to / count)};
}

// Those of each mover, between frames kMotionSpans apart.
std::vector<std::vector<CarriedRays>> carried_rays(const SmallVideo& video,
                                                   const std::vector<Mover>& movers) {
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const size_t span : kMotionSpans)
    for (size_t i = 0; i + span < video.size(); ++i) pairs.emplace_back(i, i + span);
  std::vector<std::vector<std::optional<CarriedRays>>> found(pairs.size());
  for_each_parallel(pairs.size(), num_cores(), [&](size_t k) {
    const auto [from, to] = pairs[k];
    found[k].resize(movers.size());
    std::optional<TargetFlow> flow;
    for (size_t m = 0; m < movers.size(); ++m) {
      if (!any(movers[m].masks[from]) || !any(movers[m].masks[to])) continue;
      if (!flow) flow = quick_flows(video, from, to).first;
      found[k][m] = rays_between(video, movers[m], from, to, *flow);
    }
  });
  std::vector<std::vector<CarriedRays>> rays(movers.size());
  for (const auto& of_pair : found)
    for (size_t m = 0; m < movers.size(); ++m)
      if (of_pair[m]) rays[m].push_back(*of_pair[m]);
  return rays;
}

double median_share(const Eigen::VectorXd& depths, const Eigen::VectorXd& bounds) {
  std::vector<double> shares;
  for (long k = 0; k < depths.size(); ++k) shares.push_back(depths(k) / bounds(k));
  const auto middle = shares.begin() + long(shares.size() / 2);
  std::nth_element(shares.begin(), middle, shares.end());
  return *middle;
}

// The depths at the frames where the mover is in view, by least squares with the bounds that would
// be exceeded as equations.
std::vector<double> depths_of(const SmallVideo& video, const Mover& mover,
                              const std::vector<CarriedRays>& all_rays,
                              const StillBackground& background) {
  const size_t n = video.size();
  std::vector<double> bounds(n);
  std::vector<long> variable(n, -1);
  std::vector<size_t> frames;
  for (size_t i = 0; i < n; ++i) bounds[i] = bound_of(mover.masks[i], background.depths[i]);
  bounds = steadied(bounds);
  for (size_t i = 0; i < n; ++i) {
    if (bounds[i] <= 0) continue;
    variable[i] = long(frames.size());
    frames.push_back(i);
  }
  std::vector<double> depths(n);
  if (frames.empty()) return depths;
  const long m = long(frames.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(m, m);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(m);
  for (const CarriedRays& rays : all_rays) {
    const long a = variable[rays.from], b = variable[rays.to];
    if (a < 0 || b < 0) continue;
    const double apart = double(rays.to - rays.from), weight = 1 / (apart * apart);
    const Eigen::Vector3d camera =
        video.cameras[rays.to].position() - video.cameras[rays.from].position();
    normal(a, a) += weight * rays.ray.squaredNorm();
    normal(b, b) += weight * rays.ray_to.squaredNorm();
    normal(a, b) -= weight * rays.ray.dot(rays.ray_to);
    normal(b, a) = normal(a, b);
    right(a) += weight * rays.ray.dot(camera);
    right(b) -= weight * rays.ray_to.dot(camera);
  }
  for (long k = 1; k + 1 < m; ++k) {
    if (frames[size_t(k + 1)] - frames[size_t(k - 1)] != 2) continue;
    const Eigen::Vector3d second(1, -2, 1);
    normal.block<3, 3>(k - 1, k - 1) += kSmooth * second * second.transpose();
  }
  Eigen::VectorXd most(m);
  for (long k = 0; k < m; ++k) most(k) = bounds[frames[size_t(k)]];
  std::vector<char> bound(size_t(m), 0);
  const auto solved = [&] {
    Eigen::MatrixXd with_bounds = normal;
    Eigen::VectorXd values = right;
    for (long k = 0; k < m; ++k) {
      const double weight = bound[size_t(k)] ? kBound : kPrior;
      with_bounds(k, k) += weight;
      values(k) += weight * most(k);
    }
    return with_bounds.ldlt().solve(values).eval();
  };
  Eigen::VectorXd d;
  for (int round = 0; round < 30; ++round) {
    d = solved();
    bool settled = true;
    for (long k = 0; k < m; ++k) {
      const char exceeds = d(k) > most(k);
      settled &= exceeds == bound[size_t(k)];
      bound[size_t(k)] = exceeds;
    }
    if (settled) break;
  }
  if (median_share(d, most) < kFollowed) {
    normal *= 1e-3;
    right *= 1e-3;
    std::fill(bound.begin(), bound.end(), 1);
    d = solved();
  }
  for (long k = 0; k < m; ++k) {
    const double nearest = 0.02 * most(k);  // in front of the camera
    depths[frames[size_t(k)]] = std::max(d(k), nearest);
  }
  return depths;
}

}  // namespace

NeighbourFlows neighbour_flows(const SmallVideo& video) {
  NeighbourFlows flows(video.size() - 1);
  for_each_parallel(flows.size(), num_cores(),
                    [&](size_t i) { flows[i] = quick_flows(video, i, i + 1); });
  return flows;
}

std::vector<Mover> movers_of(const SmallVideo& video, const StillBackground& background,
                             const NeighbourFlows& flows) {
  std::vector<Mover> movers = chains_of(video, background.moving, flows);
  const auto rays = carried_rays(video, movers);
  for (size_t m = 0; m < movers.size(); ++m)
    movers[m].depths = depths_of(video, movers[m], rays[m], background);
  return movers;
}

}  // namespace gflow
