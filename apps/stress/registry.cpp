// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "apps/stress/stress.hpp"

namespace gflow::stress {
namespace {

bool within(double value, double bound) { return std::isfinite(value) && value <= bound; }

int number(const Test& test) { return std::stoi(test.id.substr(1)); }

}  // namespace

bool passed(const Row& row) { return within(row.value, row.bound); }

bool passed(const Derivative& row) {
  return within(row.against_double, row.double_bound) &&
         within(row.against_differences, row.differences_bound);
}

Tests all_tests() {
  Tests all;
  for (Tests (*family)() :
       {root_tests, whitening_tests, transport_tests, motion_tests, compositing_tests, replay_tests,
        loss_tests, projection_tests, parameter_tests, poison_tests, degenerate_tests,
        optimiser_tests, gradient_tests, device_tests
#ifdef GFLOW_WITH_OPENCV
        ,
        far_tests, poison_model_tests, training_tests
#endif
       }) {
    Tests more = family();
    all.insert(all.end(), std::make_move_iterator(more.begin()),
               std::make_move_iterator(more.end()));
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Test& a, const Test& b) { return number(a) < number(b); });
  return all;
}

}  // namespace gflow::stress
