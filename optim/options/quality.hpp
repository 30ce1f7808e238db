// SPDX-License-Identifier: Apache-2.0
// One dial for how long to train: --quality of `gflow train`.
#pragma once
#include <array>
#include <string>
#include <vector>

namespace gflow {

enum class Quality { draft, standard, best };
constexpr std::array<const char*, 3> names_of(Quality) { return {"draft", "standard", "best"}; }

// What a quality sets, "section.key=value" each; of standard nothing: it is the default of every
// setting.
std::vector<std::string> settings_of(Quality quality);

}  // namespace gflow
