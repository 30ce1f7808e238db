// SPDX-License-Identifier: Apache-2.0
// The choices about image, flow and gradients that `gflow bench pareto` compares.
#pragma once
#include <string>
#include <vector>

#include "optim/engine/settings.hpp"

namespace gflow::bench {

// A choice: a knob and the settings that differ from the defaults.
struct Choice {
  std::string knob, name;
  EngineSettings settings;
  int lanes = 0;  // 0: the device's
  bool shipped() const { return knob == "shipped"; }
};

// The default choice and those of the given knobs (none given: all knobs). Skips the number of
// lanes that the device has by default. Error if a knob does not exist.
std::vector<Choice> choices_of(int lanes, const std::vector<std::string>& knobs);

}  // namespace gflow::bench
