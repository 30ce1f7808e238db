// SPDX-License-Identifier: Apache-2.0
// The stress tests of the numerics: each has a number, and gives figures with the bounds they must
// keep. `gflow stress` runs them all on a user's device, CI the quick ones.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "runtime/cl/queue.hpp"

namespace gflow::stress {

// What was looked at, how far off it was, and how far it may be. A figure that is not finite fails.
struct Row {
  std::string condition;
  double figure, bound;
};
using Rows = std::vector<Row>;

bool passed(const Row& row);

struct Test {
  std::string id, name;
  bool quick;  // not left out by --quick and by CI
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

// All of them, in the order of their numbers.
Tests all_tests();

// One hand-written derivative: how far the device's is from the double one, and that from central
// differences of the double forward function; relative L2, the worst of its parameters.
struct Derivative {
  std::string kernel, parameters;
  double against_double, against_differences;
  double double_bound, differences_bound;
};
// Of all kernels, and what the host differentiates itself.
std::vector<Derivative> derivatives(Queue& queue);
bool passed(const Derivative& row);

}  // namespace gflow::stress
