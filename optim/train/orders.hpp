// SPDX-License-Identifier: Apache-2.0
// What the leader of several devices tells the others before each step (seat.hpp), as bytes.
#pragma once
#include <string>

#include "optim/formats/npz.hpp"

namespace gflow {

struct StepOrder {
  int number = 0;        // of the step
  float rate_scale = 1;  // learning-rate scale
};

std::string order_to_step(int number, float rate_scale);
StepOrder step_of_order(const std::string& order);

// To continue from a saved state.
std::string order_of_state(const Arrays& arrays);
bool is_state(const std::string& order);
Arrays arrays_of_order(const std::string& order);

}  // namespace gflow
