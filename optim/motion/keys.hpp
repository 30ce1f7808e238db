// SPDX-License-Identifier: Apache-2.0
// Paths stored at keys, equally spaced over the video, with smooth interpolation between them.
#pragma once
#include "optim/motion/models.hpp"
#include "shared/motion/keys.h"

GFLOW_KERNEL_STRUCT(KeyWeights);

namespace gflow {

// Catmull-Rom weights of the keys at time t in [0, duration] (clamped). The path passes through
// every key with the slope between its two neighbours and is extended linearly beyond the ends. At
// a key, only that key has weight. keys >= 1.
KeyWeights key_weights(double t, double duration, int keys);

// The number of keys as a number of a model's files.
inline ShapeNumber key_count() {
  return {"keys", [](MotionShape& shape) -> int& { return shape.keys; }, 0, 1e6};
}

// Pace of a key, (keys / 2)^rule.power in [1, rule.most]: only the two intervals next to a key
// train it.
float key_rate_scale(int keys, const PaceRule& rule);

}  // namespace gflow
