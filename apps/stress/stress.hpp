// SPDX-License-Identifier: Apache-2.0
// The stress tests of the numerics. Each has a number and returns values with bounds. `gflow
// stress` runs them all on a user's device, CI the quick ones.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "runtime/cl/queue.hpp"

namespace gflow::stress {

// A test condition, the measured value and its bound. A non-finite value fails.
struct Row {
  std::string condition;
  double value, bound;
};
using Rows = std::vector<Row>;

bool passed(const Row& row);

struct Test {
  std::string id, name;
  bool quick;  // also run with --quick and in CI
  std::function<Rows(Queue&)> run;
};
using Tests = std::vector<Test>;

// By family, one file each.
Tests root_tests();
Tests whitening_tests();
Tests transport_tests();
Tests motion_tests();
Tests compositing_tests();
Tests replay_tests();
Tests loss_tests();
Tests projection_tests();
Tests parameter_tests();
Tests poison_tests();
Tests degenerate_tests();
Tests optimiser_tests();
Tests gradient_tests();
Tests device_tests();
#ifdef GFLOW_WITH_OPENCV
Tests far_tests();
Tests poison_model_tests();
Tests training_tests();
#endif

// All tests in the order of their numbers.
Tests all_tests();

// A hand-written derivative: error of the device against double, and of double against central
// differences of the double forward function; relative L2, the worst of its parameters.
struct Derivative {
  std::string kernel, parameters;
  double against_double, against_differences;
  double double_bound, differences_bound;
};
// All kernels' derivatives, and those computed on the host.
std::vector<Derivative> derivatives(Queue& queue);
bool passed(const Derivative& row);

}  // namespace gflow::stress
