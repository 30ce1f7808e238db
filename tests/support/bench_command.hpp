// SPDX-License-Identifier: Apache-2.0
// For tests of `gflow bench`: its reports and a short pareto.
#pragma once
#include <nlohmann/json.hpp>

#include "tests/support/command.hpp"

namespace gflow {

using Json = nlohmann::json;

inline Json report_in(const std::string& path) { return Json::parse(contents(path)); }

// A pareto that takes seconds, with additional options.
inline Outcome small_pareto(const std::vector<std::string>& more) {
  std::vector<std::string> words{"bench",          "pareto", "--repeats",         "1",
                                 "--pixels",       "32x32",  "--gaussians",       "200",
                                 "--check-pixels", "24x24",  "--check-gaussians", "150"};
  words.insert(words.end(), more.begin(), more.end());
  return gflow(words);
}

}  // namespace gflow
