// SPDX-License-Identifier: Apache-2.0
// Launches kernels/loss/flow_tiles.cl.
#include "optim/loss/flow_tiles.hpp"

#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "shared/constants.h"
#include "shared/random.h"

namespace gflow {
namespace {

LowMotionRule checked(const LowMotionRule& rule) {
  if (!(rule.share > 0 && rule.share <= 1))
    throw Error(
        fmt::format("choosing flow tiles: the share of low-motion tiles is {}, it must be above 0 "
                    "and at most 1",
                    rule.share));
  if (!(rule.px > 0 && std::isfinite(rule.px)))
    throw Error(fmt::format(
        "choosing flow tiles: the low-motion threshold is {} px, it must be above 0", rule.px));
  return rule;
}

}  // namespace

FlowTiles::FlowTiles(Queue& queue, const LowMotionRule& rule)
    : rule_(checked(rule)), program_(queue, "common.cl"), flow_tiles_(program_, "flow_tiles") {}

const Buffer<float>& FlowTiles::choose(Queue& queue, uint32_t seed, int width, int height,
                                       const Buffer<float>& target_flow,
                                       const Buffer<cl_uchar>& confidence) {
  const size_t pixels = size_t(width) * size_t(height);
  if (target_flow.size() < 2 * pixels || confidence.size() < pixels)
    throw Error(fmt::format(
        "choosing flow tiles of {} x {} pixels: {} has {} values, {} {}; expected two and one per "
        "pixel",
        width, height, target_flow.name(), target_flow.size(), confidence.name(),
        confidence.size()));
  const size_t tiles = ((size_t(width) + TILE - 1) / TILE) * ((size_t(height) + TILE - 1) / TILE);
  weights_.ensure(queue, tiles);
  flow_tiles_(queue, Range::over(tiles, 16), cl_uint(width), cl_uint(height), rule_.share, rule_.px,
              float(random_uniform(seed, streams::kTile, 0)), target_flow, confidence, weights_);
  return weights_;
}

}  // namespace gflow
