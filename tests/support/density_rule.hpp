// SPDX-License-Identifier: Apache-2.0
// Rules for tests of density control.
#pragma once
#include "optim/density/density.hpp"

namespace gflow {

// Nothing is pruned by its size, nothing is moved or pulled at random, and there is space.
inline DensityRule quiet_rule() {
  DensityRule rule;
  rule.cap = 30000;
  rule.prune_opacity = 0.005f;
  rule.prune_scale = rule.spread = rule.noise = 0;
  rule.opacity_weight = rule.scale_weight = 0;
  return rule;
}

}  // namespace gflow
