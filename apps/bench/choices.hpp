// SPDX-License-Identifier: Apache-2.0
// What one may choose about the image, its flow and gradients: the knobs of `gflow bench pareto`.
#pragma once
#include <string>
#include <vector>

#include "optim/engine/settings.hpp"

namespace gflow::bench {

// One choice: what differs from the settings as shipped.
struct Choice {
  std::string knob, name;
  EngineSettings settings;
  int lanes = 0;  // 0: the device's
  bool shipped() const { return knob == "shipped"; }
};

// The shipped one and those of the knobs asked for, all where none is named; none that gives the
// device as many lanes as it has. Error when there is no such knob.
std::vector<Choice> choices_of(int lanes, const std::vector<std::string>& knobs);

}  // namespace gflow::bench
