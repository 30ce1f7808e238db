// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/option.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace gflow {

Allowed one_of(std::vector<float> values) {
  Allowed range;
  range.among = std::move(values);
  return range;
}

bool Allowed::contains(int64_t value) const {
  const double number = double(value);  // a float does not tell 2000000001 from its neighbours
  if (!among.empty()) return std::find(among.begin(), among.end(), number) != among.end();
  return (or_zero && value == 0) || (number >= min && number <= max);
}

bool Allowed::contains(double value) const {
  if (!(std::fabs(value) <= std::numeric_limits<float>::max())) return false;
  const float number = static_cast<float>(value);
  if (!among.empty()) return std::find(among.begin(), among.end(), number) != among.end();
  if (or_zero && value == 0) return true;
  return (above_min ? number > min : number >= min) && number <= max;
}

std::string Allowed::text() const {
  if (!among.empty()) return fmt::format("one of {}", fmt::join(among, ", "));
  const bool bounded = max < std::numeric_limits<float>::max();
  if (or_zero) return fmt::format("0, or {} to {}", min, max);
  if (above_min)
    return bounded ? fmt::format("above {}, at most {}", min, max) : fmt::format("above {}", min);
  return bounded ? fmt::format("{} to {}", min, max) : fmt::format("at least {}", min);
}

}  // namespace gflow
