// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/chained_flow.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace gflow {
namespace {

struct Vec2 {
  float x, y;
};

// Whether two vectors probably belong to the same surface, with the tolerances of consistency().
bool moves_alike(const Vec2& a, const Vec2& b) {
  return std::hypot(a.x - b.x, a.y - b.y) < std::max(0.5f, 0.05f * std::hypot(a.x, a.y));
}

// Samples a link at pixel indices `at`; nullopt outside of the image or where the link is not
// trusted.
std::optional<Vec2> sample(const TargetFlow& link, const Vec2& at) {
  const FlowField& flow = link.flow;
  const auto trusted = [&](int x, int y) {
    return x < flow.width && y < flow.height &&
           link.confidence[size_t(y) * size_t(flow.width) + size_t(x)] > 127;
  };
  const auto value = [&](int x, int y) {
    const size_t i = 2 * (size_t(y) * size_t(flow.width) + size_t(x));
    return Vec2{flow.uv[i], flow.uv[i + 1]};
  };
  if (!(at.x >= 0 && at.y >= 0 && at.x <= float(flow.width - 1) && at.y <= float(flow.height - 1)))
    return {};
  const int near_x = int(std::lround(at.x)), near_y = int(std::lround(at.y));
  if (!trusted(near_x, near_y)) return {};
  const Vec2 nearest = value(near_x, near_y);
  const int x0 = int(std::floor(at.x)), y0 = int(std::floor(at.y));
  const float fx = at.x - float(x0), fy = at.y - float(y0);
  float weights = 0;
  Vec2 sum{0, 0};
  for (int corner = 0; corner < 4; ++corner) {
    const int x = x0 + (corner & 1), y = y0 + (corner >> 1);
    if (!trusted(x, y)) continue;
    const Vec2 there = value(x, y);
    if (!moves_alike(nearest, there)) continue;
    const float weight = (corner & 1 ? fx : 1 - fx) * (corner >> 1 ? fy : 1 - fy);
    weights += weight;
    sum.x += weight * there.x;
    sum.y += weight * there.y;
  }
  return Vec2{sum.x / weights, sum.y / weights};  // the nearest has a weight >= 1/4
}

// Indices of the links from pair.frame to pair.next; empty if a link has no flow.
std::vector<size_t> way(const FlowPair& pair, const std::map<std::pair<int, int>, size_t>& links) {
  std::vector<size_t> way;
  const int step = pair.next > pair.frame ? 1 : -1;
  for (int frame = pair.frame; frame != pair.next; frame += step) {
    const auto link = links.find({frame, frame + step});
    if (link == links.end()) return {};
    way.push_back(link->second);
  }
  return way;
}

}  // namespace

TargetFlow chained(const Links& links) {
  const FlowField& first = links.at(0)->flow;
  TargetFlow chain{zero_flow(first.width, first.height), {}};
  chain.confidence.resize(chain.flow.valid.size());
  for (int y = 0; y < first.height; ++y)
    for (int x = 0; x < first.width; ++x) {
      const size_t i = size_t(y) * size_t(first.width) + size_t(x);
      const Vec2 start{float(x), float(y)};
      std::optional<Vec2> at = start;
      for (const auto& link : links) {
        const std::optional<Vec2> motion = sample(*link, *at);
        at = motion ? std::optional<Vec2>({at->x + motion->x, at->y + motion->y}) : std::nullopt;
        if (!at) break;
      }
      chain.flow.valid[i] = at.has_value();
      if (!at) continue;
      chain.confidence[i] = 255;
      chain.flow.uv[2 * i] = at->x - start.x;
      chain.flow.uv[2 * i + 1] = at->y - start.y;
    }
  return chain;
}

TargetFlow chained(const Links& there, const Links& back) {
  TargetFlow chain = chained(there);
  chain.confidence = consistency(chain.flow, chained(back).flow);
  return chain;
}

std::vector<FlowStore::Loader> chained_flows(std::shared_ptr<FlowStore> links,
                                             const std::vector<FlowPair>& pairs,
                                             const StoreFlow& keep) {
  std::map<std::pair<int, int>, size_t> known;
  for (size_t i = 0; i < links->size(); ++i)
    if (links->has(i) && pairs[i].next >= 0) known[{pairs[i].frame, pairs[i].next}] = i;
  const auto loaded = [links](const std::vector<size_t>& way) {
    Links all;
    for (const size_t i : way) all.push_back(links->get(i));
    return all;
  };
  std::vector<FlowStore::Loader> loaders;
  for (size_t i = links->size(); i < pairs.size(); ++i) {
    const std::vector<size_t> there = way(pairs[i], known);
    const std::vector<size_t> back = way({pairs[i].next, pairs[i].frame}, known);
    if (there.empty()) {
      loaders.emplace_back();
      continue;
    }
    const FlowPair pair = pairs[i];
    const MakeFlow make = [=] {
      return back.empty() ? chained(loaded(there)) : chained(loaded(there), loaded(back));
    };
    loaders.push_back(keep && !back.empty() ? FlowStore::Loader([=] { return keep(pair, make); })
                                            : make);
  }
  return loaders;
}

}  // namespace gflow
