// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/neighbours.hpp"

#include <algorithm>
#include <cmath>

#include "optim/loss/nearest_points.hpp"

namespace gflow {
namespace {

struct FoundPair {
  cl_uint low, high;
  float distance;
  bool found_by_low;
};

// Gaussians by the time at which they search for neighbours.
std::vector<std::vector<cl_uint>> seekers(const std::vector<float>& means_t,
                                          const NeighbourRule& rule) {
  std::vector<std::vector<cl_uint>> by_moment(rule.moments);
  for (size_t i = 0; i < means_t.size(); ++i) {
    const double place = double(means_t[i]) / double(rule.duration) * double(rule.moments);
    const double last = double(rule.moments - 1);
    by_moment[size_t(std::clamp(std::floor(place), 0.0, last))].push_back(cl_uint(i));
  }
  return by_moment;
}

// Adds the neighbours that visible Gaussians of `seeking` find at one time.
void find_at(const std::vector<cl_uint>& seeking, const std::vector<float>& means,
             const std::vector<float>& opacities, size_t count, std::vector<FoundPair>& pairs) {
  std::vector<float> xyz;
  std::vector<cl_uint> there;
  for (cl_uint i = 0; i < opacities.size(); ++i) {
    const float* m = &means[3 * i];
    if (!(opacities[i] > 0) || !std::isfinite(m[0] + m[1] + m[2])) continue;
    there.push_back(i);
    xyz.insert(xyz.end(), m, m + 3);
  }
  if (there.size() < 2) return;
  NearestPoints nearest(xyz);
  for (const cl_uint i : seeking) {
    const float* m = &means[3 * i];
    if (!(opacities[i] > 0) || !std::isfinite(m[0] + m[1] + m[2])) continue;
    size_t taken = 0;
    for (const NearestPoints::Near& near : nearest.of(m, count + 1)) {
      const cl_uint j = there[near.index];
      if (j == i || taken == count) continue;
      ++taken;
      pairs.push_back({std::min(i, j), std::max(i, j), std::sqrt(near.squared), i < j});
    }
  }
}

NeighbourPairs listed_with_both(std::vector<FoundPair> pairs, size_t n) {
  const auto key = [](const FoundPair& p) {
    return std::make_tuple(p.low, p.high, !p.found_by_low);
  };
  std::sort(pairs.begin(), pairs.end(),
            [&](const FoundPair& a, const FoundPair& b) { return key(a) < key(b); });
  const auto same = [](const FoundPair& a, const FoundPair& b) {
    return a.low == b.low && a.high == b.high;
  };
  pairs.erase(std::unique(pairs.begin(), pairs.end(), same), pairs.end());

  NeighbourPairs lists;
  lists.offsets.assign(n + 1, 0);
  for (const FoundPair& p : pairs) {
    ++lists.offsets[p.low + 1];
    ++lists.offsets[p.high + 1];
  }
  for (size_t i = 0; i < n; ++i) lists.offsets[i + 1] += lists.offsets[i];
  lists.others.resize(2 * pairs.size());
  lists.distances.resize(2 * pairs.size());
  std::vector<cl_uint> next(lists.offsets.begin(), lists.offsets.end() - 1);
  const auto put = [&](cl_uint i, cl_uint other, float distance) {
    lists.others[next[i]] = other;
    lists.distances[next[i]++] = distance;
  };
  // Lower numbers first, then higher ones: pairs are sorted, so every list is ascending.
  for (const FoundPair& p : pairs) put(p.high, p.low, p.distance);
  for (const FoundPair& p : pairs) put(p.low, p.high, p.distance);
  return lists;
}

}  // namespace

NeighbourPairs find_neighbours(Queue& queue, const Parameters& parameters, Motion& motion,
                               const NeighbourRule& rule) {
  const auto by_moment = seekers(parameters["means_t"].values.read(queue), rule);
  GaussiansAt at;
  std::vector<FoundPair> pairs;
  for (size_t b = 0; b < rule.moments; ++b) {
    if (by_moment[b].empty()) continue;
    const float t = rule.duration * (float(b) + 0.5f) / float(rule.moments);
    motion.at(queue, parameters, t, nullptr, at);
    find_at(by_moment[b], at.means.read_range(queue, 0, 3 * parameters.count),
            at.opacities.read_range(queue, 0, parameters.count), rule.count, pairs);
  }
  return listed_with_both(std::move(pairs), parameters.count);
}

void save_state(const NeighbourPairs& pairs, Arrays& arrays) {
  arrays["neighbours/offsets"] = {{pairs.offsets.size()}, pairs.offsets};
  arrays["neighbours/others"] = {{pairs.others.size()}, pairs.others};
  arrays["neighbours/distances"] = {{pairs.distances.size()}, pairs.distances};
}

NeighbourPairs load_neighbours(const Arrays& arrays, size_t count, const std::string& path) {
  const auto take = [&](const char* name, auto& values) {
    const Array& array = array_named(arrays, name, path);
    if (const auto* found = std::get_if<std::decay_t<decltype(values)>>(&array.values))
      values = *found;
  };
  NeighbourPairs pairs;
  take("neighbours/offsets", pairs.offsets);
  take("neighbours/others", pairs.others);
  take("neighbours/distances", pairs.distances);
  const auto& offsets = pairs.offsets;
  const bool fits = offsets.size() == count + 1 && offsets.front() == 0 &&
                    std::is_sorted(offsets.begin(), offsets.end()) &&
                    offsets.back() == pairs.others.size() &&
                    pairs.distances.size() == pairs.others.size() &&
                    std::all_of(pairs.others.begin(), pairs.others.end(),
                                [&](cl_uint other) { return other < count; });
  if (!fits)
    throw Error(
        fmt::format("{}: the arrays neighbours/... are not pairs of {} Gaussians", path, count));
  return pairs;
}

}  // namespace gflow
