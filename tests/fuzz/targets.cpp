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

size_t memory_allowed(const Target& target, size_t size) {
  constexpr size_t mb = size_t{1} << 20;
  const bool packed = target.holds == Holds::packed && last_file == Holds::packed;
  return 64 * mb + 2 * (packed ? 64 * mb + 100 * size : size);
}

}  // namespace gflow::fuzz
