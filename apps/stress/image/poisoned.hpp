// SPDX-License-Identifier: Apache-2.0
// The scene of T29 for the engine and for the motion models: a culprit (0) at the left of an image,
// one under it (1), and others at the right. A broken culprit must not affect those at the right,
// unless it really reaches them with its size or position.
#pragma once
#include <cstring>
#include <vector>

#include "optim/engine/engine.hpp"

namespace gflow::stress {

constexpr int kPoisonedWidth = 96, kPoisonedHeight = 32;
constexpr size_t kRightFrom = 64;  // [px]; four tiles

inline bool same_bits(float a, float b) { return std::memcmp(&a, &b, sizeof(float)) == 0; }

inline bool same_image(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// Number of values of the pixels at the right, in planes [H, W], whose bits differ.
inline double changed_at_right(const std::vector<float>& now, const std::vector<float>& before) {
  double changed = 0;
  for (size_t i = 0; i < now.size(); ++i)
    changed += i % kPoisonedWidth >= kRightFrom && !same_bits(now[i], before[i]);
  return changed;
}

// Whether the culprit, drawn as entry `entry`, really covers tiles at the right, e.g. with a size
// of 1e6.
inline bool reaches_right(Queue& queue, const Engine& engine, size_t entry = 0) {
  const Splats& splats = engine.splats();
  return splats.tiles_touched.read_range(queue, entry, 1)[0] > 0 &&
         splats.tile_boxes.read_range(queue, 4 * entry, 4)[2] >= kRightFrom / 16;
}

}  // namespace gflow::stress
