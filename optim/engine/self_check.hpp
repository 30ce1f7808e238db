// SPDX-License-Identifier: Apache-2.0
// Checks what gflow relies on: accuracy of float32 functions and of determinants of long, thin
// splats, NaN tests that survive the compiler, a stable sort. Takes well under a second once the
// kernels are compiled.
#pragma once
#include <string>
#include <vector>

#include "runtime/cl/queue.hpp"

namespace gflow {

// One check; passed means value <= bound (NaN fails).
struct SelfCheckRow {
  std::string name;  // with the unit of `value`
  double value, bound;
  bool passed;
};

using SelfCheck = std::vector<SelfCheckRow>;

SelfCheckRow self_check_row(const std::string& name, double value, double bound);

// Runs all checks on the queue's device.
SelfCheck self_check(Queue& queue);

}  // namespace gflow
