// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/train_run.hpp"

#include <fmt/format.h>

#include <functional>
#include <set>

#include "optim/images/image_header.hpp"
#include "optim/init/init.hpp"
#include "optim/runs/backup.hpp"
#include "optim/runs/evaluate_run.hpp"
#include "optim/runs/staging.hpp"
#include "optim/runs/train_steps.hpp"
#include "optim/train/guidance_provider.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/summary.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// Before a previous run is replaced: Error if an image or flow file is damaged.
void require_whole_files(Preparation& prepared, bool quiet) {
  const std::vector<Frame>& frames = prepared.scene().train;
  const size_t flows = prepared.flows_in_files();
  Progress progress("look ", long(frames.size() + flows), quiet);
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

// Error if init.file cannot be used, or would be removed before it is read.
void require_first_file(const TrainOptions& config, const RunFolder& run) {
  if (run.would_remove(config.init.file))
    throw Error(fmt::format(
        "init.file {} belongs to the run in {}, which this training would replace: name another "
        "output folder, or copy the file out of it",
        config.init.file, run.folder()));
  require_init_file(config);
}

// Error if an input file or folder is among what this run replaces.
void require_elsewhere(const std::set<std::string>& files, const RunFolder& run) {
  for (const std::string& file : files)
    if (run.would_remove(file))
      throw Error(fmt::format(
          "training on {}: it lies among what a training into {} removes or replaces: name another "
          "output folder, or copy that out of there",
          file, run.folder()));
}

std::set<std::string> files_of(const Scene& scene) {
  std::set<std::string> files{scene.tracks_path};
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split)
      files.insert(
          {frame.path, frame.mask_path, frame.flow_path, frame.flow_mask_path, frame.depth_path});
  return files;
}

// The model shape of the settings, with the field's box from the checkpoint.
ModelShape shape_to_resume(const CheckpointFolder::Found& found, const Scene& scene,
                           const TrainOptions& config, const RunFolder& run) {
  ModelShape shape = model_shape(scene, config);
  if (!motion_model_of(shape.motion).has_planes) return shape;
  const HexplaneShape kept = kept_shape(found.checkpoint, found.path, run).hexplane;
  shape.hexplane.centre = kept.centre;
  shape.hexplane.half_size = kept.half_size;
  return shape;
}

// Whether training is finished and has a model but no checkpoint, for lack of space.
bool is_over_without_checkpoint(const RunFolder& run, const TrainOptions& config) {
  if (!run.checkpoints().steps().empty() || run.models().empty()) return false;
  const RunFacts ended = run.read_facts();
  return ended.finished && ended.iterations == run.models()[0] &&
         setting_values(run.read_config()) == setting_values(config);
}

// Whether all final files of a training exist besides its last checkpoint, and are readable.
bool is_complete(const RunFolder& run, int steps) {
  const RunFacts ended = run.read_facts();
  if (!ended.finished || ended.iterations != steps) return false;
  try {
    read_model(run.model_path(steps));
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

Evaluation train_run(Queue& queue, const TrainOptions& config, const RunFolder& run, bool quiet,
                     Start start, const TrainExtensions& extensions) {
  check(config);
  run.require_its_folders();
  restore_backup(run);
  const bool begins = start != Start::resume || run.checkpoints().steps().empty();
  require_elsewhere(
      {config.scene.path, config.scene.cameras, config.flow.folder, config.flow.tracks,
       config.guidance.images, config.guidance.model, config.metrics.lpips, config.metrics.clip},
      run);
  if (begins) require_first_file(config, run);
  StopSentence stop("interrupted while reading the scene; nothing was lost");
  Preparation prepared(config, run.path("frames"));
  const Scene& scene = prepared.scene();
  require_elsewhere(files_of(scene), run);  // input files may be links
  if (start == Start::resume && is_over_without_checkpoint(run, config)) {
    if (!quiet) print_status("the training in {} is over; its model is judged\n", run.folder());
    if (scene.test.empty()) return {};
    const RunEvaluation judged = evaluate_run(queue, run, "test", quiet, latest_iteration, {});
    if (judged.written.empty())
      throw Error(
          fmt::format("judging the model in {}: another gflow works in that folder, so no results "
                      "are written; start this again when it is done",
                      run.folder()));
    return judged.evaluation;
  }
  if (begins) require_first_points(scene, config.init);
  require_metric_networks(config, scene, prepared.frames());
  const std::vector<int> saved = run.checkpoints().steps();
  const bool finished =
      start == Start::resume && !saved.empty() && saved[0] >= config.train.iterations;
  std::unique_ptr<Guidance> guidance = finished ? nullptr : guidance_of(config);
  run.make();
  const FileLock lock = run.lock();
  restore_backup(run, lock);  // another process may have been killed since
  run.forget_unfinished_files();
  run.claim_linked_folders();
  std::optional<CheckpointFolder::Found> resumed;
  if (start == Start::resume) resumed = checkpoint_to_resume(queue, config, scene, run, quiet);
  if (!resumed && start != Start::overwrite) require_no_training(run);
  const bool has_steps_left = !resumed || resumed->checkpoint.facts.step < config.train.iterations;
  if (finished && has_steps_left) guidance = guidance_of(config);  // last checkpoint damaged
  const bool complete = resumed && !has_steps_left && is_complete(run, config.train.iterations);
  run.remove_stale_caches(cache_stamp(scene, config.scene));
  for (const Frame& frame : scene.test) prepared.frames().rgb(frame);  // reports broken images now
  prepared.find_motion_masks();  // may throw if the scene lacks what init.from asks for

  // The inputs are valid. A previous run or its results stay until the first step of this one
  // succeeds with finite values.
  const bool goes_on = resumed.has_value();
  const bool replaces = !goes_on && run.holds_training();
  const bool begins_now = !goes_on && !replaces;
  if (replaces) require_whole_files(prepared, quiet);
  std::optional<HostModel> first;
  bool begun = false;
  const auto begin_run = [&](bool changes) {
    const StagedFiles next(run);
    next.folder().write_config(config);
    next.folder().write_cameras(scene);
    if (first) write_model(next.folder().path("input.ply"), *first);
    first.reset();
    next.require_names();
    Backup former(run);
    if (!goes_on) former.put_aside(run.training());
    if (changes) former.put_aside(run.results());
    next.take_name("config.toml");  // from here on the folder belongs to this run
    former.give_up();
    begun = true;  // even if the following fails
    next.take_names();
  };
  if (begins_now) begin_run(true);
  const std::string left =
      replaces ? "the former training is as it was" : how_to_resume(run, config);
  stop.say("interrupted while preparing the training; " + left);
  warn_of_idle_settings(scene, config);
  if (!quiet) print_status("{}", in_words(scene, prepared.frames().cameras()));
  if (prepared.lacks_flow()) stop.say("interrupted while computing optical flow; " + left);
  prepared.compute_flow(run.path("flow"), quiet);

  stop.say("interrupted before the first training step; " + left);
  const auto first_model = [&] {
    first = prepared.first_model(queue);
    if (begins_now) write_model(run.path("input.ply"), *first);
    if (!quiet)
      print_status(
          "{}", first_gaussians_in_words(*first, scene, config.init, prepared.began_with_stereo()));
    return Model(queue, *first);
  };
  Model model =
      resumed ? Model(queue, shape_to_resume(*resumed, scene, config, run), 0) : first_model();
  if (begins_now) first.reset();
  if (!quiet) print_status("motion model: {}\n", name_of(model.shape.motion));
  Trainer trainer = prepared.trainer(queue, model, guidance.get(), extensions.objectives);
  CheckpointFacts former;
  if (resumed) {
    trainer.set_state(queue, resumed->checkpoint.arrays, resumed->path);
    former = resumed->checkpoint.facts;
    resumed.reset();  // frees its arrays, which are as large as the model
    run.keep_metrics_before(former.step);
  }
  Checkpointer checkpoints(queue, config, scene, run, trainer, model.shape);
  Training training{queue,
                    config,
                    run,
                    model,
                    trainer,
                    checkpoints,
                    Stopwatch(former.seconds),
                    extensions.observer};
  std::optional<InterruptGuard> guard;
  int steps = 0;
  try {
    FirstStep at_first;
    if (!begun) at_first = {[&] { begin_run(true); }, replaces};
    steps = train_steps(training, former.step, guard, quiet, at_first);
  } catch (const Error& problem) {
    if (begun || goes_on || Backup::are_aside(run)) throw;
    throw Error(fmt::format("{}; {}", problem.what(), left));
  }
  prepared.flows().prefetch({});  // cancel prefetching for steps that are not made
  if (!guard) guard.emplace();
  if (!begun) begin_run(!goes_on);  // no step was left to make
  const RunFacts facts = complete ? run.read_facts() : keep_result(training, steps);
  stop.say(
      fmt::format("interrupted while evaluating; the model is in {}, `gflow eval {}` judges it",
                  run.model_path(steps), run.folder()));
  guard.reset();
  if (interrupted())
    throw Interrupted(fmt::format("interrupted after {} of {} steps; the model is in {}, {}", steps,
                                  config.train.iterations, run.model_path(steps),
                                  how_to_resume(run, config)));
  if (scene.test.empty()) return {};
  try {
    const Evaluation evaluation =
        evaluate_views(queue, model, config, prepared.loaded(), scene.test, quiet, run.path("test"),
                       run.path("flow"));
    write_comparison(queue, model, config, prepared.loaded(), run);
    // Last, because it marks the run as finished.
    run.write_results(evaluation, "test", facts, config, model.parameters.count);
    return evaluation;
  } catch (const DiskFull& full) {
    throw DiskFull(fmt::format("{}; the model is in {}, `gflow eval {}` judges it", full.what(),
                               run.model_path(steps), run.folder()));
  }
}

}  // namespace gflow
