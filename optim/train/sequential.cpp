// SPDX-License-Identifier: Apache-2.0
#include "optim/train/sequential.hpp"

#include <algorithm>

#include "runtime/base/error.hpp"

namespace gflow {

void require_sequence(const TrainOptions& config, const Scene& scene, const MotionShape& shape) {
  if (!config.train.sequential) return;
  const int steps = std::max(scene.steps, 1);
  const auto keys = motion_model_of(shape.motion).keys;
  if (!keys || keys(shape) != steps)
    throw Error(
        "train.sequential requires motion.model = \"keyframes\" and motion.keys = 0 (one key per "
        "time step)");
  std::vector<bool> seen(size_t(steps), false);
  for (const Frame& frame : scene.train) seen[size_t(frame.step)] = true;
  const auto unseen = std::find(seen.begin(), seen.end(), false);
  if (unseen != seen.end())
    throw Error(fmt::format(
        "train.sequential requires a training image for every time step, but scene '{}' "
        "has none for time step {} (from 0)",
        scene.name, unseen - seen.begin()));
}

Stage stage_at(const ScheduleOptions& config, int time_steps, int step) {
  if (!config.sequential) return {-1, step == 0, double(step) / config.iterations};
  // Stage s ends before training step end(s); each has at least one step if there are enough.
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
