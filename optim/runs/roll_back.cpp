// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/roll_back.hpp"

#include <fmt/format.h>

#include <cmath>

#include "optim/motion/parameters_state.hpp"

namespace gflow {

bool is_finite_report(const StepReport& now, const StepReport& before) {
  return std::isfinite(now.loss) && now.non_finite.empty() && now.stuck == 0 &&
         now.rejected <= before.rejected + 10 + now.gaussians / 1000;
}

std::string what_is_non_finite(const StepReport& report, int step) {
  if (!std::isfinite(report.loss))
    return fmt::format("the loss is {} at step {}", std::isnan(report.loss) ? "NaN" : "infinite",
                       step);
  if (!report.non_finite.empty())
    return fmt::format("{} contains NaN or Inf at step {}", report.non_finite, step);
  if (report.stuck > 0)
    return fmt::format(
        "{} shared rows of parameters had ten non-finite gradients in a row at step {}",
        report.stuck, step);
  return fmt::format("{} rows of parameters had non-finite gradients at step {}", report.rejected,
                     step);
}

int RollBack::roll_back(int step, const StepReport& report, std::string& notice) {
  const std::string what = what_is_non_finite(report, step);
  std::optional<CheckpointFolder::Found> last = run_.checkpoints().latest();
  const int from = last ? last->checkpoint.facts.step : -1;
  times_ = from == from_ ? times_ + 1 : 1;
  from_ = from;
  if (!last || times_ > most) {
    const std::string path = run_.path("broken.npz");
    checkpoints_.write_to(path, step);
    throw Error(fmt::format(
        "training {}: {}, {}; a learning rate (lr.*), a weight or another setting in its "
        "config.toml is too large; its last state is in {}",
        run_.folder(), what,
        last ? fmt::format("as after each of {} rollbacks to step {} with halved learning rates",
                           most, from)
             : "and there is no checkpoint to return to",
        path));
  }
  const float scale = trainer_.rate_scale() / 2;
  trainer_.set_state(queue_, last->checkpoint.arrays, last->path);
  trainer_.set_rate_scale(scale);
  run_.keep_metrics_before(from);
  notice =
      fmt::format("{}: rolled back to step {}, learning rates scaled by {}", what, from, scale);
  return from;
}

void RollBack::save_if_finite(int step, double seconds, const std::optional<StepReport>& before) {
  queue_.finish();
  StepReport now = trainer_.counts(queue_);
  now.non_finite = non_finite_array(trainer_.state(queue_));
  if (is_finite_report(now, before.value_or(now))) checkpoints_.write(step, seconds);
}

}  // namespace gflow
