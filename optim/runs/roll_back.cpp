// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/roll_back.hpp"

#include <fmt/format.h>

#include <cmath>

#include "optim/motion/parameters_state.hpp"

namespace gflow {

bool is_sound(const StepFigures& now, const StepFigures& before) {
  return std::isfinite(now.loss) && now.unsound.empty() && now.stuck == 0 &&
         now.refused <= before.refused + 10 + now.gaussians / 1000;
}

std::string what_is_unsound(const StepFigures& figures, int step) {
  if (!std::isfinite(figures.loss))
    return fmt::format("the loss is {} at step {}",
                       std::isnan(figures.loss) ? "no number" : "infinite", step);
  if (!figures.unsound.empty())
    return fmt::format("{} has values that are no numbers at step {}", figures.unsound, step);
  if (figures.stuck > 0)
    return fmt::format(
        "{} rows of parameters that all Gaussians share had ten gradients in a row that are no "
        "numbers at step {}",
        figures.stuck, step);
  return fmt::format("{} rows of parameters had gradients that are no numbers at step {}",
                     figures.refused, step);
}

int RollBack::go_back(int step, const StepFigures& figures, std::string& notice) {
  const std::string what = what_is_unsound(figures, step);
  std::optional<CheckpointFolder::Found> last = run_.checkpoints().latest();
  const int from = last ? last->checkpoint.facts.step : -1;
  times_ = from == from_ ? times_ + 1 : 1;
  from_ = from;
  if (!last || times_ > most) {
    const std::string path = run_.path("broken.npz");
    checkpoints_.write_to(path, step);
    throw Error(fmt::format(
        "training {}: {}, {}; a learning rate (lr.*), a weight or another setting in its "
        "config.toml is too large; the state it came to is kept in {}",
        run_.folder(), what,
        last ? fmt::format("as after each of {} returns to step {} with half the learning rates",
                           most, from)
             : "and there is no checkpoint to go back to",
        path));
  }
  const float caution = trainer_.caution() / 2;
  trainer_.set_state(queue_, last->checkpoint.arrays, last->path);
  trainer_.set_caution(caution);
  run_.keep_metrics_before(from);
  notice =
      fmt::format("{}: back to step {}, learning rates times {} from there", what, from, caution);
  return from;
}

void RollBack::save_what_there_is(int step, double seconds,
                                  const std::optional<StepFigures>& before) {
  queue_.finish();
  StepFigures now = trainer_.counts(queue_);
  now.unsound = unsound_array(trainer_.state(queue_));
  if (is_sound(now, before.value_or(now))) checkpoints_.write(step, seconds);
}

}  // namespace gflow
