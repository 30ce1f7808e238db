// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/node_places.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "optim/motion/farthest_points.hpp"
#include "shared/motion/nodes.h"

namespace gflow {
namespace {

constexpr size_t kAsked = 16384;  // Gaussians that are asked which nodes carry them, at most
constexpr double kIdle = 0.05;    // share of the mean load below which a node may be moved
constexpr double kHeavy = 1.5;    // and above which it is relieved

// Sorts points so that each NODE_GROUP of them lies together: halves them along their longest axis,
// again and again. begin to end: rows of xyz [n, 3].
void sort_into_groups(const std::vector<float>& xyz, size_t* begin, size_t* end) {
  const size_t groups = (size_t(end - begin) + NODE_GROUP - 1) / NODE_GROUP;
  if (groups < 2) return;
  size_t axis = 0;
  float longest = -1;
  for (size_t c = 0; c < 3; ++c) {
    const auto [low, high] = std::minmax_element(
        begin, end, [&](size_t a, size_t b) { return xyz[3 * a + c] < xyz[3 * b + c]; });
    const float length = xyz[3 * *high + c] - xyz[3 * *low + c];
    if (length > longest) longest = length, axis = c;
  }
  std::stable_sort(begin, end,
                   [&](size_t a, size_t b) { return xyz[3 * a + axis] < xyz[3 * b + axis]; });
  size_t* middle = begin + groups / 2 * NODE_GROUP;
  sort_into_groups(xyz, begin, middle);
  sort_into_groups(xyz, middle, end);
}

double squared_distance(const float* a, const float* b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += (double(a[c]) - double(b[c])) * (double(a[c]) - double(b[c]));
  return sum;
}

// What nodes carry: the sum of the Gaussians' weights, and those whose largest weight it is.
struct Load {
  double weight = 0;
  std::vector<const float*> means;
};

// The loads of nodes by the Gaussian at `mean` (shared/motion/nodes.h).
void add_load(const float* mean, const NodePlaces& nodes, std::vector<Load>& loads) {
  std::array<std::pair<double, size_t>, NODE_NEIGHBOURS> near;  // squared distance, node
  near.fill({std::numeric_limits<double>::infinity(), 0});
  for (size_t k = 0; k < loads.size(); ++k) {
    std::pair<double, size_t> next{squared_distance(mean, &nodes.places[3 * k]), k};
    for (auto& one : near)
      if (next.first < one.first) std::swap(next, one);
  }
  std::array<double, NODE_NEIGHBOURS> weights;
  double least = std::numeric_limits<double>::infinity(), sum = 0;
  for (size_t j = 0; j < near.size(); ++j) {
    weights[j] = 0.5 * near[j].first * std::exp(-2.0 * double(nodes.log_radii[near[j].second]));
    least = std::min(least, weights[j]);
  }
  if (!std::isfinite(least)) return;  // a broken Gaussian
  for (double& w : weights) sum += w = std::exp(least - w);
  for (size_t j = 0; j < near.size(); ++j) loads[near[j].second].weight += weights[j] / sum;
  const size_t most = size_t(std::max_element(weights.begin(), weights.end()) - weights.begin());
  loads[near[most].second].means.push_back(mean);
}

// Puts a node half way from `place` to the farthest of the Gaussians that it carries, and divides
// the load between the two. Changes nothing and returns false if all of them are at one place.
bool share_load(const float* place, Load& load, float* other_place, Load& other) {
  const auto nearer = [&](const float* a, const float* b) {
    return squared_distance(a, place) < squared_distance(b, place);
  };
  const float* far = *std::max_element(load.means.begin(), load.means.end(), nearer);
  if (!(squared_distance(far, place) > 0)) return false;
  for (int c = 0; c < 3; ++c) other_place[c] = 0.5f * (place[c] + far[c]);
  const auto stays =
      std::stable_partition(load.means.begin(), load.means.end(), [&](const float* mean) {
        return squared_distance(mean, place) <= squared_distance(mean, other_place);
      });
  const double part = double(load.means.end() - stays) / double(load.means.size());
  other.means.assign(stays, load.means.end());
  load.means.erase(stays, load.means.end());
  other.weight = load.weight * part;
  load.weight *= 1 - part;
  return true;
}

}  // namespace

void place_nodes(const MotionShape& shape, HostGroups& groups, size_t first, size_t end) {
  const size_t nodes = groups.at("node_log_radii").size();
  const std::vector<float>& means = groups.at("means");
  if (end == 0) return;
  std::vector<size_t> chosen = farthest_points(means, first, end, nodes);
  sort_into_groups(means, chosen.data(), chosen.data() + chosen.size());
  std::vector<float>& places = groups["node_places"];
  for (size_t k = 0; k < nodes; ++k)
    for (size_t c = 0; c < 3; ++c) places[3 * k + c] = means[3 * chosen[k % chosen.size()] + c];
  for (size_t k = 0; k < nodes; ++k) {
    std::vector<double> squared;
    for (size_t j = 0; j < nodes; ++j)
      if (j != k) squared.push_back(squared_distance(places, j, k));
    const size_t near = std::min<size_t>(NODE_NEIGHBOURS - 1, squared.size());
    std::partial_sort(squared.begin(), squared.begin() + long(near), squared.end());
    double sum = 0;
    for (size_t j = 0; j < near; ++j) sum += std::sqrt(squared[j]) / double(near);
    const double least = 1e-3 * double(shape.hexplane.half_size[0]);
    groups["node_log_radii"][k] = float(std::log(std::max(sum, least)));
  }
}

std::vector<size_t> relieve_nodes(const std::vector<float>& means, NodePlaces& nodes) {
  const size_t n = means.size() / 3, count = nodes.log_radii.size();
  std::vector<Load> loads(count);
  const size_t stride = std::max<size_t>(1, (n + kAsked - 1) / kAsked);
  for (size_t i = 0; i < n; i += stride) add_load(&means[3 * i], nodes, loads);
  const double mean = double((n + stride - 1) / stride) / double(count);

  std::vector<size_t> from(count);
  std::iota(from.begin(), from.end(), size_t(0));
  for (size_t k = 0; k < count; ++k) {
    if (loads[k].weight >= kIdle * mean) continue;
    const auto lighter = [](const Load& a, const Load& b) { return a.weight < b.weight; };
    const auto heaviest = std::max_element(loads.begin(), loads.end(), lighter);
    if (heaviest->weight < kHeavy * mean || heaviest->means.size() < 2) break;
    const size_t heavy = size_t(heaviest - loads.begin());
    if (!share_load(&nodes.places[3 * heavy], *heaviest, &nodes.places[3 * k], loads[k])) break;
    nodes.log_radii[k] = nodes.log_radii[heavy];
    from[k] = from[heavy];
  }

  std::vector<size_t> order(count), rows(count);
  std::iota(order.begin(), order.end(), size_t(0));
  sort_into_groups(nodes.places, order.data(), order.data() + count);
  const NodePlaces moved = nodes;
  for (size_t k = 0; k < count; ++k) {
    std::copy_n(&moved.places[3 * order[k]], 3, &nodes.places[3 * k]);
    nodes.log_radii[k] = moved.log_radii[order[k]];
    rows[k] = from[order[k]];
  }
  return rows;
}

}  // namespace gflow
