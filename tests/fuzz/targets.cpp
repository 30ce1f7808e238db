// SPDX-License-Identifier: Apache-2.0
#include "fuzz/targets.hpp"

namespace gflow::fuzz {

Holds last_file = Holds::packed;

const std::vector<Target>& targets() {
  static const std::vector<Target> all = [] {
    std::vector<Target> joined;
    for (const auto& some : {splat_targets(), file_targets(), scene_targets(), run_targets()})
      joined.insert(joined.end(), some.begin(), some.end());
    return joined;
  }();
  return all;
}

}  // namespace gflow::fuzz
