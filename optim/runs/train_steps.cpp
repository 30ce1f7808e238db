// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/train_steps.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <utility>

#include "optim/motion/parameters_state.hpp"
#include "optim/runs/roll_back.hpp"
#include "optim/train/guidance_provider.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

std::vector<ProgressTerm> terms_of(const StepFigures& f) {
  std::vector<ProgressTerm> terms{{"loss", fmt::format("{:.4f}", f.loss)},
                                  {"L1", fmt::format("{:.4f}", f.l1)},
                                  {"psnr", fmt::format("{:.1f}", f.psnr)}};
  if (f.epe > 0) terms.push_back({"epe", fmt::format("{:.2f} px", f.epe)});
  if (f.motion && std::isfinite(f.motion->total()))
    terms.push_back({"motion", fmt::format("{:.4f}", f.motion->total())});
  if (f.guidance && std::isfinite(f.guidance->pull))
    terms.push_back({"guidance", fmt::format("{:.4f}", f.guidance->pull)});
  terms.push_back({"", fmt::format("{} Gaussians", f.gaussians)});
  if (f.moving < f.gaussians) terms.push_back({"", fmt::format("{} move", f.moving)});
  if (f.refused) terms.push_back({"refused", std::to_string(f.refused)});
  return terms;
}

void save_model(Queue& queue, const Model& model, const RunFolder& run, int iteration) {
  const std::string path = run.model_path(iteration);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code problem;
  std::filesystem::create_directories(folder, problem);
  if (problem) throw Error(fmt::format("cannot make {}: {}", folder.string(), problem.message()));
  flush_folder_of(folder.string());
  write_model(path, model.read(queue));
}

// A model on the way; that it does not fit on the disk is no reason to stop.
void try_save_model(Queue& queue, const Model& model, const RunFolder& run, int iteration) {
  try {
    save_model(queue, model, run, iteration);
  } catch (const Error& problem) {
    warn(fmt::format("no point cloud of step {}: {}; training goes on", iteration, problem.what()));
  }
}

// Nor is a line of the log that does not.
void try_append_metrics(const RunFolder& run, int step, double seconds,
                        const StepFigures& figures) {
  try {
    run.append_metrics(step, seconds, figures);
  } catch (const Error& problem) {
    warn(fmt::format("no metrics of step {}: {}; training goes on", step, problem.what()));
  }
}

// Whether the n-th step is the last of a round of `every`; 0: there are none.
bool ends_round(int n, int every) { return every > 0 && n % every == 0; }

// What to throw when the guidance of a step failed; the steps before it are saved.
Error without_guidance(const GuidanceFailed& problem, const Training& training, int step) {
  const RunFolder& run = training.run;
  if (step == 0)
    return Error(fmt::format("{}; no step was trained, {}", problem.what(),
                             how_to_go_on(run, training.config)));
  training.checkpoints.write(step, training.watch.seconds());
  return Error(fmt::format("{}; {} steps are saved, {}", problem.what(), step,
                           how_to_go_on(run, training.config)));
}

// Whether the device failed.
bool is_of_device(const Error& error) {
  return is_out_of_memory(error) || dynamic_cast<const ClError*>(&error);
}

// That a program does not build is none of the device's doing.
bool did_not_build(const Error& error) {
  const auto* of_opencl = dynamic_cast<const ClError*>(&error);
  return of_opencl && of_opencl->code == CL_BUILD_PROGRAM_FAILURE;
}

// The same when the device failed, or a picture or flow could not be read. The step may not have
// begun to change anything, and a device that only wants memory may still answer: then the steps
// before it are saved. `before`: the last figures that were looked at.
Error without_step(const Error& problem, const Training& training, int step, RollBack& roll_back,
                   const std::optional<StepFigures>& before) {
  const RunFolder& run = training.run;
  const auto saved = [&] {
    const std::vector<int> steps = run.checkpoints().steps();
    return steps.empty() ? 0 : steps[0];
  };
  const bool may_answer = is_out_of_memory(problem) || !is_of_device(problem);
  if (saved() < step && may_answer && training.trainer.untouched()) try {
      roll_back.save_what_there_is(step, training.watch.seconds(), before);
    } catch (const Error&) {  // what there is to say is why the step failed
    }
  if (saved() == 0) return Error(fmt::format("{}; no step is saved", problem.what()));
  return Error(fmt::format("{}; {} of {} steps are saved, {}", problem.what(), saved(), step,
                           how_to_go_on(run, training.config)));
}

// Runs what writes something of the end; "" or why it could not. Where the disk is full, older
// checkpoints make room for the model.
std::string why_not(const RunFolder& run, const std::function<void()>& write) {
  try {
    try {
      write();
    } catch (const DiskFull& full) {
      if (!run.checkpoints().make_room(full)) throw;
      write();
    }
  } catch (const Error& problem) {
    return problem.what();
  }
  return "";
}

// What to throw when the end could not be kept in full: `model` and `rest` are why not, or "".
Error not_all_kept(const Training& training, int steps, const std::string& model,
                   const std::string& rest) {
  const RunFolder& run = training.run;
  const std::vector<int> saved = run.checkpoints().steps();
  const int last = saved.empty() ? 0 : saved[0];
  std::string go_on;
  if (last > 0)
    go_on = "; once that is mended, " + how_to_go_on(run, training.config);
  else if (model.empty() && steps == training.config.train.iterations)
    go_on = fmt::format("; once that is mended, `gflow eval {}` judges it", run.folder());
  if (model.empty())
    return Error(
        fmt::format("{}; the model is in {}, {}{}", rest, run.model_path(steps),
                    last > 0 ? fmt::format("the last checkpoint is of step {} of {}", last, steps)
                             : "there is no checkpoint",
                    go_on));
  if (last == steps)
    return Error(fmt::format("{}; all {} steps are kept in {}{}", model, steps,
                             run.checkpoints().path(last), go_on));
  return Error(fmt::format("{}; {} of {} steps are saved{}", model, last, steps, go_on));
}

// Steps of the training before, 0 where nothing can tell: no reason to lose this one.
int stopped_at(const RunFolder& run) {
  try {
    return run.read_facts().iterations;
  } catch (const Error&) {
    return 0;
  }
}

}  // namespace

int train_steps(Training& training, int step, std::optional<InterruptGuard>& guard, bool quiet,
                FirstStep first) {
  auto& [queue, config, run, model, trainer, checkpoints, watch] = training;
  const ScheduleConfig& plan = config.train;
  Progress progress("train", plan.iterations, quiet, step);
  RollBack roll_back(queue, run, trainer, checkpoints);
  StepFigures figures;
  std::optional<StepFigures> before;
  bool begun = !first.replaces;
  const auto begin = [&] {
    if (const auto then = std::exchange(first.then, {})) then();
    begun = true;
  };
  const auto time_is_over = [&] {
    return begun && plan.minutes > 0 && training.watch.seconds() > 60 * double(plan.minutes);
  };
  for (; step < plan.iterations && !(guard && interrupted()) && !time_is_over(); ++step) {
    try {
      trainer.step(queue, step);
    } catch (const GuidanceFailed& problem) {
      if (guard && interrupted()) break;  // the step has not begun
      progress.finish();
      if (!begun) throw;
      throw without_guidance(problem, training, step);
    } catch (const Error& problem) {
      progress.finish();
      if (!begun || did_not_build(problem)) throw;
      throw without_step(problem, training, step, roll_back, before);
    }
    if (!guard) {
      queue.finish();
      guard.emplace();
    }
    if (!first.replaces) begin();
    const std::string notice = trainer.take_notice();
    if (!notice.empty()) progress.say("gflow: " + notice);
    const int done = step + 1;
    const bool last = done == plan.iterations, logs = step % plan.log_every == 0 || last;
    const bool saves = !last && ends_round(done, plan.checkpoint_every);
    const bool shows = !last && ends_round(done, plan.save_every);
    if (logs || saves || shows) {  // what is kept is looked at before
      figures = trainer.figures(queue);
      if (last || saves || shows) figures.unsound = unsound_array(trainer.state(queue));
      if (!is_sound(figures, before.value_or(figures))) {
        if (!begun) throw Error(what_is_unsound(figures, done));
        std::string sentence;
        step = roll_back.go_back(done, figures, sentence) - 1;
        progress.say("gflow: " + sentence);
        continue;
      }
      before = figures;
      begin();
    }
    if (logs) try_append_metrics(run, step, watch.seconds(), figures);
    progress.update(done, terms_of(figures));
    if (shows) try_save_model(queue, model, run, done);
    if (saves) checkpoints.try_write(done, watch.seconds());
  }
  queue.finish();
  progress.finish();
  return step;
}

RunFacts keep_result(Training& training, int steps) {
  const RunFolder& run = training.run;
  const RunFacts facts{steps,
                       training.watch.seconds(),
                       peak_memory_mib(),
                       training.queue.info.full_name(),
                       name_of(training.model.shape.motion),
                       !interrupted()};
  const std::string unsound = unsound_array(training.trainer.state(training.queue));
  if (!unsound.empty()) {  // stopped between two looks at it
    training.checkpoints.write_to(run.path("broken.npz"), steps);
    const std::string sentence = fmt::format(
        "training {}: {} has values that are no numbers after {} steps, which are kept in "
        "broken.npz; {}",
        run.folder(), unsound, steps,
        run.checkpoints().steps().empty() ? "no step is saved"
                                          : how_to_go_on(run, training.config));
    if (interrupted()) throw Interrupted(sentence);
    throw Error(sentence);
  }
  const int stopped = stopped_at(run);  // where it was gone on from
  // Each is worth having without the other: either of them holds the model. The checkpoint comes
  // first, as one who is stopped at once in between can go on from it.
  const std::string no_facts = why_not(run, [&] { run.write_facts(facts); });
  const std::string no_checkpoint =
      why_not(run, [&] { training.checkpoints.write(steps, facts.train_seconds); });
  const std::string no_model =
      why_not(run, [&] { save_model(training.queue, training.model, run, steps); });
  if (no_model.empty() && stopped != steps &&
      !ends_round(stopped, training.config.train.save_every))
    run.forget_model(stopped);
  const std::string no_rest = no_checkpoint.empty() ? no_facts : no_checkpoint;
  if (no_model.empty() && no_rest.empty()) return facts;
  throw not_all_kept(training, steps, no_model, no_rest);
}

}  // namespace gflow
