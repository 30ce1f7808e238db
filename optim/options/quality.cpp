// SPDX-License-Identifier: Apache-2.0
#include "optim/options/quality.hpp"

#include <fmt/ranges.h>

#include <algorithm>

#include "runtime/base/printable.hpp"

namespace gflow {

void apply_quality(TrainOptions& config, const std::string& word) {
  if (std::find(kQualities.begin(), kQualities.end(), word) == kQualities.end())
    throw Error(
        fmt::format("quality must be {}, not '{}'", fmt::join(kQualities, " or "), excerpt(word)));
  if (word == "standard") config.train.iterations = TrainOptions{}.train.iterations;
  if (word == "draft") config.train.iterations = 2000;
  if (word == "best") {
    config.train.iterations = 60000;
    config.motion.trial_steps = 2000;
  }
}

}  // namespace gflow
