// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/train_run.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "optim/images/image_header.hpp"
#include "optim/init/init.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/options/scene_defaults.hpp"
#include "optim/runs/evaluate_run.hpp"
#include "optim/runs/follow.hpp"
#include "optim/runs/model_trials.hpp"
#include "optim/runs/replacement.hpp"
#include "optim/runs/train_steps.hpp"
#include "optim/scene/move_cameras.hpp"
#include "optim/train/guidance_provider.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/summary.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// What all ways of carrying out a plan need.
struct RunParts {
  Queue& queue;
  const TrainOptions& config;
  const RunFolder& run;
  Preparation& prepared;
  Guidance* guidance;
  const TrainExtensions& extensions;
  StopSentence& stop;
  bool quiet;

  const Scene& scene() const { return prepared.scene(); }
};

// Error if an input file or folder is among those that training removes or replaces.
void require_inputs_elsewhere(const TrainOptions& config, const RunFolder& run) {
  for (const std::string& input :
       {config.scene.path, config.scene.cameras, config.flow.folder, config.flow.tracks,
        config.init.file, config.guidance.images, config.guidance.model, config.metrics.lpips,
        config.metrics.clip})
    if (run.would_remove(input))
      throw Error(
          fmt::format("training on {0}: training into {1} would remove or replace it; name another "
                      "output folder, or copy {0} out of {1}",
                      input, run.folder()));
}

// Before a previous run is replaced: Error if an image or flow file is damaged.
void require_whole_files(Preparation& prepared, bool quiet) {
  const std::vector<Frame>& frames = prepared.scene().train;
  const size_t flows = prepared.flows_in_files();
  Progress progress("check", long(frames.size() + flows), quiet);
  for (const Frame& frame : frames) {
    if (frame.video_frame < 0) check_image_bytes(read_file(frame.path), frame.path);
    if (!frame.mask_path.empty()) check_image_bytes(read_file(frame.mask_path), frame.mask_path);
    progress.advance();
  }
  for (size_t pair = 0; pair < flows; ++pair) {
    if (prepared.flows().has(pair)) prepared.flows().get(pair);
    progress.advance();
  }
  progress.finish();
}

// The model shape of the settings, with the numbers that a run keeps from the checkpoint.
ModelShape shape_to_resume(const CheckpointFolder::Found& found, const Scene& scene,
                           const TrainOptions& config, const RunFolder& run) {
  ModelShape shape = model_shape(scene, config);
  if (!motion_model_of(shape.motion).kept_numbers.empty())
    enclose_as(shape, kept_shape(found.checkpoint, found.path, run));
  return shape;
}

// What motion.model was when the training began: auto only if no trials chose it.
MotionChoice model_begun_with(const Checkpoint& checkpoint) {
  TrainOptions begun;
  apply_text(begun, checkpoint.facts.config, "the settings of a checkpoint");
  return begun.motion.model;
}

void write_first_files(const RunFolder& files, const RunParts& parts) {
  files.write_config(parts.config);
  files.write_cameras(parts.prepared.frames(),
                      near_or_default(parts.config.render.near, parts.scene()));
}

// Computes what the first step needs besides a model. left: what remains if it is interrupted.
void prepare(RunParts& parts, const std::string& left) {
  const auto& [queue, config, run, prepared, guidance, extensions, stop, quiet] = parts;
  stop.set("interrupted while preparing the training; " + left);
  if (!quiet) {
    print_status("{}", in_words(prepared.scene(), prepared.frames().cameras()));
    print_status("Gaussians are drawn from {:.3g} scene units before a camera on (render.near)\n",
                 near_or_default(config.render.near, prepared.scene()));
    print_status("{}", colors_in_words(prepared.scene(), config));
    print_status("{}", steps_in_words(prepared.scene(), config.train));
  }
  if (prepared.lacks_flow()) stop.set("interrupted while computing optical flow; " + left);
  prepared.compute_flow(run.path("flow"), quiet,
                        [observer = extensions.observer](size_t done, size_t pairs) {
                          if (observer) observer->on_flow(done, pairs);
                        });
  stop.set("interrupted before the first training step; " + left);
}

HostModel first_model(RunParts& parts) {
  const HostModel first = parts.prepared.first_model(parts.queue, parts.quiet);
  if (!parts.quiet)
    print_status("{}", first_gaussians_in_words(first, parts.scene(), parts.config.init,
                                                parts.prepared.place_of_points()));
  return first;
}

// Whether the run is to have the initial model as a checkpoint: a background was trained for it.
bool saves_first_model(const RunParts& parts) {
  return !parts.prepared.motion_masks().empty() && parts.config.train.checkpoint_every > 0;
}

std::string interrupted_while_evaluating(const RunFolder& run, int iteration) {
  return fmt::format(
      "interrupted while evaluating; the model is in {}, `gflow eval {}` evaluates it",
      run.model_path(iteration), run.folder());
}

// Without test views some training views are evaluated, and no results are written.
Evaluation evaluate_result(RunParts& parts, Model& model, const RunFacts& facts) {
  const auto& [queue, config, run, prepared, guidance, extensions, stop, quiet] = parts;
  const Scene& scene = prepared.scene();
  const bool tested = !scene.test.empty();
  const std::vector<Frame> views = tested ? scene.test : sample_of(scene.train, 20);
  try {
    const Evaluation evaluation =
        evaluate_views(queue, model, config, prepared.loaded(), views, quiet,
                       tested ? run.path("test") : "", run.path("flow"));
    if (evaluation.fitted_cameras)
      run.write_cameras(prepared.frames(), near_or_default(config.render.near, scene));
    write_comparison(queue, model, config, prepared.loaded(), views, run);
    // Last, because it marks the run as finished.
    if (tested) run.write_results(evaluation, "test", facts, config, model.parameters.count);
    return evaluation;
  } catch (const DiskFull& full) {
    throw DiskFull(fmt::format("{}; the model is in {}, `gflow eval {}` evaluates it", full.what(),
                               run.model_path(facts.iterations), run.folder()));
  }
}

// Makes the steps after the checkpoint, or all of them, then saves and evaluates the result.
Evaluation train_and_evaluate(RunParts& parts, Model& model,
                              std::optional<CheckpointFolder::Found> checkpoint,
                              const FirstStep& at_first) {
  const auto& [queue, config, run, prepared, guidance, extensions, stop, quiet] = parts;
  if (!quiet) print_status("motion model: {}\n", name_of(model.shape.motion));
  Trainer trainer = prepared.trainer(queue, model, guidance, extensions.objectives);
  CheckpointFacts before;
  if (checkpoint) {
    trainer.set_state(queue, checkpoint->checkpoint.arrays, checkpoint->path);
    before = checkpoint->checkpoint.facts;
    checkpoint.reset();  // frees its arrays, which are as large as the model
    run.keep_metrics_before(before.step);
  }
  Checkpointer checkpoints(queue, config, prepared.scene(), run, trainer, model.shape);
  Training training{queue,
                    config,
                    run,
                    model,
                    trainer,
                    checkpoints,
                    Stopwatch(before.seconds),
                    Validation(queue, config, prepared.loaded()),
                    prepared.frames(),
                    extensions.observer};
  if (extensions.seat) {
    if (!prepared.motion_masks().empty())
      throw Error("training on several devices: a scene of one moving camera needs one device");
    lead(*extensions.seat, queue, prepared.scene(), checkpoints, before.step, trainer);
  }
  std::optional<InterruptGuard> guard;
  const int steps = train_steps(training, before.step, guard, quiet, at_first);
  if (extensions.seat) extensions.seat->end();
  prepared.flows().prefetch({});  // cancel prefetching for steps that are not made
  if (!guard) guard.emplace();
  const RunFacts facts = keep_result(training, steps);
  stop.set(interrupted_while_evaluating(run, steps));
  guard.reset();
  if (interrupted())
    throw Interrupted(fmt::format("interrupted after {} of {} steps; the model is in {}, {}", steps,
                                  config.train.iterations, run.model_path(steps),
                                  how_to_resume(run, config)));
  return evaluate_result(parts, model, facts);
}

Evaluation train_fresh(RunParts& parts) {
  begin_run(parts.run, [&](const RunFolder& files) { write_first_files(files, parts); });
  prepare(parts, how_to_resume(parts.run, parts.config));
  HostModel first = first_model(parts);
  write_model(parts.run.path("input.ply"), first);
  write_motion_masks(parts.run.path("moving"), parts.prepared.motion_masks());
  Model model(parts.queue, first);
  first = {};
  return train_and_evaluate(parts, model, std::nullopt, {{}, false, saves_first_model(parts)});
}

// The previous run stays until the first step of this one succeeds with finite values.
Evaluation train_replacing(RunParts& parts) {
  const std::string unchanged = "the previous run is unchanged";
  require_whole_files(parts.prepared, parts.quiet);
  prepare(parts, unchanged);
  HostModel first = first_model(parts);
  Model model(parts.queue, first);
  bool begun = false;
  const auto begin = [&] {
    begin_run(parts.run, [&](const RunFolder& files) {
      write_first_files(files, parts);
      write_model(files.path("input.ply"), first);
      write_motion_masks(files.path("moving"), parts.prepared.motion_masks());
    });
    first = {};
    begun = true;
  };
  try {
    return train_and_evaluate(parts, model, std::nullopt, {begin, true, saves_first_model(parts)});
  } catch (const Error& problem) {
    if (begun || is_replacement_pending(parts.run)) throw;
    throw Error(fmt::format("{}; {}", problem.what(), unchanged));
  }
}

Evaluation resume_training(RunParts& parts, CheckpointFolder::Found checkpoint) {
  prepare(parts, how_to_resume(parts.run, parts.config));
  MotionMasks masks = read_motion_masks(parts.run.path("moving"), parts.scene());
  if (masks.empty() && begins_with_background(parts.scene(), parts.config))
    warn(
        fmt::format("{} lacks motion masks that the run began with: training continues without "
                    "focus on what moves",
                    parts.run.path("moving")));
  parts.prepared.set_motion_masks(std::move(masks));
  Model model(parts.queue, shape_to_resume(checkpoint, parts.scene(), parts.config, parts.run), 0);
  const auto renew = [&] {
    write_first_files(parts.run, parts);
    parts.run.remove_results();  // those of fewer steps
  };
  return train_and_evaluate(parts, model, std::move(checkpoint), {renew, false});
}

// A process that was killed or had no space at its end may have saved the last checkpoint only.
Evaluation only_evaluate(RunParts& parts) {
  const RunFolder& run = parts.run;
  const RunState state = read_run_state(run);
  RunFacts facts = run.read_facts();
  if (state.checkpoint) run.write_model(state.iteration, state.model);
  if (!facts.finished || facts.iterations != state.iteration) {
    remove_model_of_stop(run, parts.config, facts.iterations, state.iteration);
    facts = state.facts;
    facts.peak_memory_mib = peak_memory_mib();
    facts.finished = true;
    run.write_facts(facts);
  }
  if (refines_cameras(parts.config.cameras, parts.scene())) {
    run.move_cameras(parts.prepared.frames());
    undo_fits(parts.scene(), parts.prepared.frames());
  }
  write_first_files(run, parts);  // some settings may be others than before
  Model model(parts.queue, state.model, Purpose::rendering);
  parts.stop.set(interrupted_while_evaluating(run, state.iteration));
  return evaluate_result(parts, model, facts);
}

}  // namespace

Evaluation train_run(Queue& queue, const TrainOptions& options, const RunFolder& run, bool quiet,
                     Start start, const TrainExtensions& extensions) {
  check(options);
  if (extensions.seat) require_divisible(options, extensions.seat->devices());
  TrainOptions config = options;
  const std::unique_ptr<WarningsTo> warnings = warnings_to(extensions.observer);
  run.require_its_folders();
  std::unique_ptr<FileLock> lock;
  const auto take_folder = [&] {
    run.make();
    lock.reset(new FileLock(run.lock()));
    complete_replacement(run, *lock);
    run.forget_unfinished_files();
  };
  // A new folder is made only after the inputs have been checked.
  if (std::filesystem::exists(run.folder())) take_folder();
  RunPlan plan = plan_run(run, config, start);
  require_inputs_elsewhere(config, run);
  if (plan.starts_fresh()) require_init_file(config);
  StopSentence stop("interrupted while reading the scene; nothing was lost");
  if (chooses_by_trials(config)) {
    stop.set("interrupted while trying motion models; nothing was begun");
    config.motion.model = plan.checkpoint ? model_begun_with(plan.checkpoint->checkpoint)
                                          : model_by_trials(queue, config, quiet);
  }
  Preparation prepared(config, run.path("frames"));
  const Scene& scene = prepared.scene();
  if (plan.checkpoint) require_resumable(*plan.checkpoint, queue, config, scene, run);
  if (plan.starts_fresh()) require_first_points(scene, config.init);
  require_metric_networks(config, scene, prepared.frames());
  const std::unique_ptr<Guidance> guidance =
      plan.kind == RunPlan::only_evaluate ? nullptr : guidance_of(config);
  if (!lock) {
    take_folder();
    require_no_training(run);  // another process may have had the same idea
  }
  run.remove_stale_caches(cache_stamp(scene, config.scene));
  if (!quiet && start == Start::resume) print_status("{}\n", in_words(plan, run));
  RunParts parts{queue, config, run, prepared, guidance.get(), extensions, stop, quiet};
  if (plan.kind == RunPlan::only_evaluate) return only_evaluate(parts);
  // The remaining inputs, before anything of a previous run is touched.
  for (const Frame& frame : scene.test) prepared.frames().rgb(frame);
  prepared.find_motion_masks();  // Error if the scene lacks what init.from asks for
  if (plan.kind == RunPlan::resume) return resume_training(parts, *std::move(plan.checkpoint));
  return plan.kind == RunPlan::replace ? train_replacing(parts) : train_fresh(parts);
}

}  // namespace gflow
