// SPDX-License-Identifier: Apache-2.0
#include "optim/train/sequence.hpp"

#include <algorithm>

namespace gflow {

Stage stage_at(const ScheduleConfig& config, int time_steps, int step) {
  if (!config.sequential) return {-1, step == 0, double(step) / config.iterations};
  // Stage s ends before training step end(s); each has at least one, if there are enough.
  const int later = time_steps - 1;
  const double first =
      later > 0 ? double(config.first_share) * config.iterations : double(config.iterations);
  const auto end = [&](int s) {
    const double share = later > 0 ? double(s) / later : 0;
    return s == later ? config.iterations : int(first + share * (config.iterations - first));
  };
  int stage = 0;
  while (stage < later && step >= end(stage)) ++stage;
  const int begin = stage ? end(stage - 1) : 0;
  return {stage, step == begin, double(step - begin) / std::max(end(stage) - begin, 1)};
}

}  // namespace gflow
