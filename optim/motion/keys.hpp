// SPDX-License-Identifier: Apache-2.0
// Paths held at keys, equally spaced over the video, and smooth between them.
#pragma once
#include "optim/motion/motion.hpp"
#include "shared/keys.h"

GFLOW_KERNEL_STRUCT(KeyWeights);

namespace gflow {

// The keys that make a path at time t in [0, duration] (clamped), by Catmull and Rom's cubic: it
// goes through every key with the slope of its two neighbours, straight on beyond the ends; on a
// key only that key counts. keys >= 1.
KeyWeights key_weights(double t, double duration, int keys);

// How much faster a key learns than what is always seen: it is touched by the times around it only,
// two parts of `keys`.
float key_pace(int keys, const PaceRule& rule);

}  // namespace gflow
