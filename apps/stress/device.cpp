// SPDX-License-Identifier: Apache-2.0
// T46: the self-check of a device before gflow uses it (also printed by `gflow devices`).
#include "apps/stress/stress.hpp"
#include "optim/motion/gradient_check.hpp"

namespace gflow::stress {
namespace {

Rows self_checks(Queue& queue) {
  Rows rows;
  for (const SelfCheckRow& row : full_self_check(queue))
    rows.push_back({row.name, row.value, row.bound});
  return rows;
}

}  // namespace

Tests device_tests() { return {{"T46", "self-check at start", true, self_checks}}; }

}  // namespace gflow::stress
