// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_plan.hpp"

#include <fmt/format.h>

#include "optim/runs/resume.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Whether training is finished and has a model but no checkpoint, for lack of space.
bool is_over_without_checkpoint(const RunFolder& run, const TrainOptions& config) {
  if (run.models().empty()) return false;
  const RunFacts ended = run.read_facts();
  return ended.finished && ended.iterations == run.models()[0] &&
         setting_values(run.read_config()) == setting_values(config);
}

}  // namespace

RunPlan plan_run(const RunFolder& run, const TrainOptions& config, Start start) {
  RunPlan plan;
  if (start == Start::overwrite) {
    plan.kind = run.holds_training() ? RunPlan::replace : RunPlan::fresh;
    return plan;
  }
  if (start == Start::resume && !run.checkpoints().steps().empty()) {
    plan.checkpoint = run.checkpoints().latest();
    const int step = plan.checkpoint->checkpoint.facts.step;
    plan.kind = step < config.train.iterations ? RunPlan::resume : RunPlan::only_evaluate;
  } else if (start == Start::resume && is_over_without_checkpoint(run, config)) {
    plan.kind = RunPlan::only_evaluate;
  } else {
    require_no_training(run);
    if (start == Start::fresh && RunFolder::is_run(run.folder()))
      warn(
          fmt::format("{} holds a training that was stopped before its first checkpoint: it is "
                      "replaced, and training starts at the first step",
                      run.folder()));
  }
  return plan;
}

std::string in_words(const RunPlan& plan, const RunFolder& run) {
  if (plan.kind == RunPlan::only_evaluate)
    return fmt::format("the training in {} is finished: evaluating its model", run.folder());
  return plan.checkpoint
             ? fmt::format("continuing from {}", plan.checkpoint->path)
             : fmt::format("{} has no checkpoint: training starts at the first step", run.folder());
}

void require_no_training(const RunFolder& run) {
  if (!run.holds_training()) return;
  TrainOptions former;
  RunFacts ended;
  std::optional<CheckpointFolder::Found> last;
  try {
    former = run.read_config();
    last = run.checkpoints().latest();
    ended = run.read_facts();
  } catch (const Error&) {  // damaged: decide by the rest
  }
  if (run.checkpoints().steps().empty() && run.models().empty())
    throw Error(
        fmt::format("{} holds results of a training, but neither a model nor a checkpoint: name "
                    "another folder, or replace them with --overwrite",
                    run.folder()));
  if (run.checkpoints().steps().empty())
    throw Error(
        fmt::format("{} holds a model, but no checkpoint to continue from: evaluate it with `gflow "
                    "eval {}`, name another folder, or replace it with --overwrite",
                    run.folder(), run.folder()));
  const int all = former.train.iterations;
  const int step = last ? last->checkpoint.facts.step : all;
  const bool out_of_time = ended.finished && ended.iterations == step;  // ended by train.minutes
  if (step < all && !out_of_time)
    throw Error(
        fmt::format("{} holds a training that was stopped at step {} of {}: `{}` continues it, "
                    "--overwrite starts over",
                    run.folder(), step, all, resuming_command(run, former)));
  throw Error(fmt::format(
      "{} contains a finished run{}: name another folder, or replace it with --overwrite",
      run.folder(), former.scene.path.empty() ? "" : " of " + former.scene.path));
}

}  // namespace gflow
