// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/train_steps.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "optim/motion/parameters_state.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/runs/roll_back.hpp"
#include "optim/train/guidance_provider.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

std::vector<ProgressTerm> terms_of(const StepReport& report) {
  std::vector<ProgressTerm> terms{{"loss", fmt::format("{:.4f}", report.loss)}};
  for (const Term& term : report.terms)
    if (!term.progress.empty()) terms.push_back({"", term.progress});
  terms.push_back({"", fmt::format("{} Gaussians", report.gaussians)});
  if (report.moving < report.gaussians)
    terms.push_back({"", fmt::format("{} dynamic", report.moving)});
  if (report.rejected) terms.push_back({"rejected", std::to_string(report.rejected)});
  return terms;
}

// Saves an intermediate model; a full disk does not stop training.
void try_save_model(Queue& queue, const Model& model, const RunFolder& run, int iteration) {
  try {
    run.write_model(iteration, model.read(queue));
  } catch (const Error& problem) {
    warn(fmt::format("point cloud of step {} not saved: {}; training continues", iteration,
                     problem.what()));
  }
}

// Writes the cameras that training has corrected; a failure does not stop training.
void try_write_cameras(const Training& training) {
  const Scene& scene = training.trainer.scene();
  if (!refines_cameras(training.config.cameras, scene)) return;
  try {
    training.run.write_cameras(training.frames,
                               near_or_default(training.config.render.near, scene));
  } catch (const Error& problem) {
    warn(fmt::format("cameras not saved: {}; training continues", problem.what()));
  }
}

void try_save_checkpoint(const Training& training, int step) {
  training.checkpoints.try_write(step, training.watch.seconds());
  try_write_cameras(training);
}

// Appends a line of the log; a failure does not stop training.
void try_append_metrics(const RunFolder& run, int step, double seconds, const StepReport& report) {
  try {
    run.append_metrics(step, seconds, report);
  } catch (const Error& problem) {
    warn(fmt::format("metrics of step {} not saved: {}; training continues", step, problem.what()));
  }
}

// Whether step n is the last of a round of `every` steps; 0: no rounds.
bool ends_round(int n, int every) { return every > 0 && n % every == 0; }

// The error to throw if the guidance of a step failed; the steps before it are saved.
Error without_guidance(const GuidanceFailed& problem, const Training& training, int step) {
  const RunFolder& run = training.run;
  if (step == 0)
    return Error(fmt::format("{}; no step was trained, {}", problem.what(),
                             how_to_resume(run, training.config)));
  training.checkpoints.write(step, training.watch.seconds());
  return Error(fmt::format("{}; {} steps are saved, {}", problem.what(), step,
                           how_to_resume(run, training.config)));
}

// Whether the device failed.
bool is_of_device(const Error& error) {
  return is_out_of_memory(error) || dynamic_cast<const ClError*>(&error);
}

// A kernel build error is not a failure of the device.
bool did_not_build(const Error& error) {
  const auto* of_opencl = dynamic_cast<const ClError*>(&error);
  return of_opencl && of_opencl->code == CL_BUILD_PROGRAM_FAILURE;
}

// The error to throw if the device failed, or an image or flow could not be read. The step may not
// have changed anything yet, and a device that ran out of memory may still respond: then the steps
// before it are saved. `before`: the last report that was checked.
Error without_step(const Error& problem, const Training& training, int step, RollBack& roll_back,
                   const std::optional<StepReport>& before) {
  const RunFolder& run = training.run;
  const auto saved = [&] {
    const std::vector<int> steps = run.checkpoints().steps();
    return steps.empty() ? 0 : steps[0];
  };
  const bool may_answer = is_out_of_memory(problem) || !is_of_device(problem);
  if (saved() < step && may_answer && training.trainer.untouched()) try {
      roll_back.save_if_finite(step, training.watch.seconds(), before);
    } catch (const Error&) {  // report why the step failed instead
    }
  if (saved() == 0) return Error(fmt::format("{}; no step is saved", problem.what()));
  return Error(fmt::format("{}; {} of {} steps are saved, {}", problem.what(), saved(), step,
                           how_to_resume(run, training.config)));
}

// Writes a part of the result; returns "" or the reason of failure. If the disk is full, older
// checkpoints make room.
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

// The error to throw if the result could not be saved in full; `model` and `rest` are reasons of
// failure, or "".
Error not_all_kept(const Training& training, int steps, const std::string& model,
                   const std::string& rest) {
  const RunFolder& run = training.run;
  const std::vector<int> saved = run.checkpoints().steps();
  const int last = saved.empty() ? 0 : saved[0];
  std::string go_on;
  if (last > 0)
    go_on = "; once that is fixed, " + how_to_resume(run, training.config);
  else if (model.empty() && steps == training.config.train.iterations)
    go_on = fmt::format("; once that is fixed, `gflow eval {}` evaluates it", run.folder());
  if (model.empty())
    return Error(fmt::format(
        "{}; the model is in {}, {}{}", rest, run.model_path(steps),
        saved.empty() ? "there is no checkpoint"
                      : fmt::format("the last checkpoint is of step {} of {}", last, steps),
        go_on));
  if (last == steps)
    return Error(fmt::format("{}; all {} steps are saved in {}{}", model, steps,
                             run.checkpoints().path(last), go_on));
  return Error(fmt::format("{}; {} of {} steps are saved{}", model, last, steps, go_on));
}

// Steps of the previous process, 0 if unknown, which is no reason to lose this result.
int stopped_at(const RunFolder& run) {
  try {
    return run.read_facts().iterations;
  } catch (const Error&) {
    return 0;
  }
}

// Observes the steps of a run: log, intermediate models and checkpoints, roll-back, interruption.
class RunObserver : public TrainObserver {
 public:
  RunObserver(Training& training, int from, std::optional<InterruptGuard>& guard, bool quiet,
              FirstStep first)
      : training_(training),
        guard_(guard),
        first_(std::move(first)),
        begun_(!first_.replaces),
        done_(from),
        progress_("train", training.config.train.iterations, quiet, from),
        roll_back_(training.queue, training.run, training.trainer, training.checkpoints) {}

  bool stop(int done) override {
    done_ = done;
    const bool stops = is_interrupted() || is_out_of_time() ||
                       (training_.observer && training_.observer->stop(done));
    in_step_ = !stops;
    return stops;
  }

  // The last measurement of views that are held back; "" if there is none.
  const std::string& validation_in_words() const { return validation_in_words_; }

  void on_notice(const std::string& sentence) override {
    progress_.print_line("gflow: " + sentence);
    if (training_.observer) training_.observer->on_notice(sentence);
  }

  void after_step(TrainState& state) override {
    in_step_ = false;
    if (!guard_) {
      training_.queue.finish();
      guard_.emplace();
    }
    if (!first_.replaces) begin();
    if (!keep(state)) return;
    if (training_.observer) training_.observer->after_step(state);
  }

  // The current step failed. Rethrows or throws the error to report; returns if the user had
  // interrupted before it began.
  void on_guidance_failure(const GuidanceFailed& problem) {
    if (is_interrupted()) return;
    progress_.finish();
    if (!begun_) throw;
    throw without_guidance(problem, training_, done_);
  }
  void on_failure(const Error& problem) {
    progress_.finish();
    if (!in_step_ || !begun_ || did_not_build(problem)) throw;
    throw without_step(problem, training_, done_, roll_back_, before_);
  }

  int done() const { return done_; }
  void finish() { progress_.finish(); }

 private:
  bool is_interrupted() const { return guard_ && interrupted(); }
  bool is_out_of_time() const {
    const float minutes = training_.config.train.minutes;
    return begun_ && minutes > 0 && training_.watch.seconds() > 60 * double(minutes);
  }
  void begin() {
    if (const auto then = std::exchange(first_.then, {})) then();
    begun_ = true;
  }

  // Writes what is due after a step, after checking it. Returns false if training has returned to
  // its last checkpoint instead.
  bool keep(TrainState& state) {
    auto& [queue, config, run, model, trainer, checkpoints, watch, validation, frames, observer] =
        training_;
    const ScheduleOptions& plan = config.train;
    const int done = state.done;
    const bool last = done == plan.iterations;
    const bool validates = validation.possible() && (last || ends_round(done, plan.validate_every));
    const bool logs = (done - 1) % plan.log_every == 0 || last || validates;
    const bool saves =
        !last && (ends_round(done, plan.checkpoint_every) || (first_.saves && !begun_));
    const bool shows = !last && ends_round(done, plan.save_every);
    if (logs || saves || shows) {
      report_ = state.report();
      if (last || saves || shows) report_.non_finite = non_finite_array(trainer.state(queue));
      if (!is_finite_report(report_, before_.value_or(report_))) {
        if (!begun_) throw Error(what_is_non_finite(report_, done));
        std::string sentence;
        state.done = roll_back_.roll_back(done, report_, sentence);
        on_notice(sentence);
        return false;
      }
      before_ = report_;
      begin();
      if (validation.possible()) report_validation(validates, done);
    }
    if (logs) try_append_metrics(run, done - 1, watch.seconds(), report_);
    progress_.update(done, terms_of(report_));
    if (shows) try_save_model(queue, model, run, done);
    if (saves) checkpoints.try_write(done, watch.seconds());
    if (shows || saves) try_write_cameras(training_);
    return true;
  }

  // Adds the terms of the validation to the report; NaN in lines between two of them.
  void report_validation(bool measures, int done) {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    ValidationPsnr psnr{none, none};
    if (measures) {
      psnr = training_.validation.measure(training_.queue, training_.model);
      shown_validation_ = fmt::format("val {:.1f}", psnr.val);
      validation_in_words_ = fmt::format(
          "validation: PSNR {:.2f} dB of views that are held back, {:.2f} dB of trained ones "
          "(matched colours)\n",
          psnr.val, psnr.train);
      const std::string warning = training_.validation.warning(psnr, done);
      if (!warning.empty()) on_notice(warning);
    }
    report_.terms.push_back({"val_psnr", psnr.val, shown_validation_});
    report_.terms.push_back({"val_psnr_train", psnr.train, ""});
  }

  Training& training_;
  std::optional<InterruptGuard>& guard_;
  FirstStep first_;
  bool begun_;
  int done_;
  bool in_step_ = false;
  Progress progress_;
  RollBack roll_back_;
  std::string shown_validation_;  // in the progress line
  std::string validation_in_words_;
  StepReport report_;                 // last report read
  std::optional<StepReport> before_;  // last finite report
};

}  // namespace

int train_steps(Training& training, int step, std::optional<InterruptGuard>& guard, bool quiet,
                FirstStep first) {
  if (first.saves && !first.replaces) try_save_checkpoint(training, step);
  RunObserver observer(training, step, guard, quiet, std::move(first));
  try {
    step = train_loop(training.queue, training.trainer, step, training.config.train.iterations,
                      observer);
  } catch (const GuidanceFailed& problem) {
    observer.on_guidance_failure(problem);
    step = observer.done();
    training.queue.finish();
  } catch (const Error& problem) {
    observer.on_failure(problem);
  }
  observer.finish();
  if (!quiet) print_status("{}", observer.validation_in_words());
  return step;
}

void remove_model_of_stop(const RunFolder& run, const TrainOptions& config, int stopped,
                          int steps) {
  if (stopped != steps && !ends_round(stopped, config.train.save_every)) run.remove_model(stopped);
}

RunFacts keep_result(Training& training, int steps) {
  const RunFolder& run = training.run;
  const RunFacts facts{steps,
                       training.watch.seconds(),
                       peak_memory_mib(),
                       training.queue.info.full_name(),
                       name_of(training.model.shape.motion),
                       !interrupted()};
  const std::string unsound = non_finite_array(training.trainer.state(training.queue));
  if (!unsound.empty()) {  // stopped between two checks
    training.checkpoints.write_to(run.path("broken.npz"), steps);
    const std::string sentence = fmt::format(
        "training {}: {} contains NaN or Inf after {} steps; its last state is in broken.npz; {}",
        run.folder(), unsound, steps,
        run.checkpoints().steps().empty() ? "no step is saved"
                                          : how_to_resume(run, training.config));
    if (interrupted()) throw Interrupted(sentence);
    throw Error(sentence);
  }
  const int stopped = stopped_at(run);  // step at which the previous process stopped
  // Each is useful without the other, since both contain the model. The checkpoint is first, so
  // that a process killed in between can be resumed.
  const std::string no_facts = why_not(run, [&] { run.write_facts(facts); });
  const std::string no_checkpoint =
      why_not(run, [&] { training.checkpoints.write(steps, facts.train_seconds); });
  const std::string no_model =
      why_not(run, [&] { run.write_model(steps, training.model.read(training.queue)); });
  if (no_model.empty()) remove_model_of_stop(run, training.config, stopped, steps);
  try_write_cameras(training);
  const std::string no_rest = no_checkpoint.empty() ? no_facts : no_checkpoint;
  if (no_model.empty() && no_rest.empty()) return facts;
  throw not_all_kept(training, steps, no_model, no_rest);
}

}  // namespace gflow
