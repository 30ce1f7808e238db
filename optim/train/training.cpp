// SPDX-License-Identifier: Apache-2.0
#include "optim/train/training.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>

#include "optim/data/image_header.hpp"
#include "optim/data/true_depth.hpp"
#include "optim/io/atomic_file.hpp"
#include "optim/io/interrupt.hpp"
#include "optim/train/begin.hpp"
#include "optim/train/guidance_source.hpp"
#include "optim/train/init.hpp"
#include "optim/train/judging_networks.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/progress.hpp"
#include "optim/train/rendering.hpp"
#include "optim/train/resume.hpp"
#include "optim/train/roll_back.hpp"
#include "optim/train/warning.hpp"
#include "runtime/usage.hpp"

namespace gflow {
namespace {

// Training time, that of earlier processes included.
class Stopwatch {
 public:
  explicit Stopwatch(double before) : before_(before) {}
  double seconds() const {
    return before_ + std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  double before_;
  Clock::time_point start_ = Clock::now();
};

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

// Everything that cached flow and video frames depend on: pictures and masks by path, size and time
// of change, which picture follows which, what is undone of the lens, and how flow is computed.
std::string cache_stamp(const Scene& scene, const SceneConfig& config) {
  namespace fs = std::filesystem;
  std::string stamp = fmt::format("packed DIS flow, resolution {} background {}\n",
                                  config.resolution, name_of(config.background));
  const auto add_file = [&](const std::string& path) {
    stamp += fmt::format("{} {} {}\n", path, fs::file_size(path),
                         fs::last_write_time(path).time_since_epoch().count());
  };
  std::string last;
  for (const std::vector<Frame>* frames : {&scene.train, &scene.test})
    for (const Frame& frame : *frames) {
      stamp += frame.name + "\n";
      if (!frame.mask_path.empty()) add_file(frame.mask_path);
      if (frame.path == last) continue;  // the next frame of one video
      add_file(frame.path);
      last = frame.path;
    }
  for (const Camera& camera : scene.cameras)
    if (camera.lens.kind != Lens::Kind::none)
      stamp += fmt::format("lens {} {} of {} {} {} {} as {} {}\n", int(camera.lens.kind),
                           fmt::join(camera.lens.k, " "), camera.lens.fx, camera.lens.fy,
                           camera.lens.cx, camera.lens.cy, camera.fx, camera.fy);
  return stamp;
}

// The views, and the paths in space where the scene has true ones. What is drawn goes into the
// folder `pictures` unless that is empty; flow: the folder of what was computed.
Evaluation judge(Queue& queue, Model& model, const TrainConfig& config, const LoadedScene& loaded,
                 const std::vector<Frame>& frames, bool quiet, const std::string& pictures,
                 const std::string& flow) {
  if (!pictures.empty()) std::filesystem::create_directories(pictures);
  Progress progress("eval ", long(frames.size()), quiet);
  Evaluation evaluation =
      evaluate(queue, model, config, loaded, frames, counted(progress), pictures, flow);
  progress.finish();
  if (!loaded.scene.tracks_path.empty()) {
    Tracks tracks = read_tracks(loaded.scene.tracks_path, loaded.scene.origin);
    mark_seen(tracks, loaded.scene, *loaded.frames);
    evaluation.tracks = track_error(queue, model, tracks);
  }
  return evaluation;
}

// What the result will be judged by, once: better told now than at the end.
void require_what_judges(const TrainConfig& config, const Scene& scene, const FrameStore& frames) {
  const JudgingNetworks networks(config.metrics);
  for (const Frame& frame : scene.test) {
    const Camera& camera = frames.camera(frame);
    networks.require_size(camera.width, camera.height);
    if (!frame.depth_path.empty()) read_true_depth(frame, camera.width, camera.height);
  }
  if (!scene.tracks_path.empty()) read_tracks(scene.tracks_path, scene.origin);
}

// The settings of a run with some of [metrics] changed; Error for any other. A network that judged
// the run before does so again unless the settings say otherwise.
TrainConfig judged_by(const TrainConfig& config, const MetricsConfig& before,
                      const std::vector<std::string>& settings) {
  TrainConfig changed = config;
  const auto keep = [](std::string& network, const std::string& former) {
    if (network.empty() && std::filesystem::exists(former)) network = former;
  };
  keep(changed.metrics.lpips, before.lpips);
  keep(changed.metrics.clip, before.clip);
  for (const std::string& setting : settings) {
    apply_setting(changed, setting);
    TrainConfig rest = changed;
    rest.metrics = config.metrics;
    if (setting_values(rest) != setting_values(config))
      throw Error(
          fmt::format("--set {}: a run is judged with the settings it was trained with; only "
                      "those of [metrics] may be others",
                      setting));
  }
  if (!settings.empty()) make_paths_absolute(changed.metrics);
  return changed;
}

// Before a former training is given up for another one: Error where a picture is damaged.
void require_whole_pictures(const Scene& scene) {
  for (const Frame& frame : scene.train) {
    if (frame.video_frame < 0) check_image_bytes(read_file(frame.path), frame.path);
    if (!frame.mask_path.empty()) check_image_bytes(read_file(frame.mask_path), frame.mask_path);
  }
}

// Error when the file that training begins with cannot be used, or would be gone by then.
void require_first_file(const TrainConfig& config, const RunFolder& run) {
  if (run.would_forget(config.init.file))
    throw Error(fmt::format(
        "init.file {} belongs to the run in {}, which this training would replace: name another "
        "output folder, or copy the file out of it",
        config.init.file, run.folder()));
  require_init_file(config);
}

// What to throw when the guidance of a step failed; the steps before it are saved.
Error without_guidance(const GuidanceFailed& problem, int step, double seconds,
                       Checkpointer& checkpoints, const RunFolder& run) {
  if (step == 0)
    return Error(fmt::format("{}; no step was trained, {}", problem.what(), how_to_go_on(run)));
  checkpoints.write(step, seconds);
  return Error(fmt::format("{}; {} steps are saved, {}", problem.what(), step, how_to_go_on(run)));
}

// Whether the device failed. That a program does not build is none of its doing.
bool is_of_device(const Error& error) {
  const auto* of_opencl = dynamic_cast<const ClError*>(&error);
  return is_out_of_memory(error) || (of_opencl && of_opencl->code != CL_BUILD_PROGRAM_FAILURE);
}

// The same when the device failed. For want of memory the step may not have begun to change
// anything, and the device may still answer: then the steps before it are saved. `before`: the last
// figures that were looked at.
Error without_device(const Error& problem, const Trainer& trainer, int step, double seconds,
                     RollBack& roll_back, const std::optional<StepFigures>& before,
                     const RunFolder& run) {
  const auto saved = [&] {
    const std::vector<int> steps = run.checkpoints().steps();
    return steps.empty() ? 0 : steps[0];
  };
  if (saved() < step && is_out_of_memory(problem) && trainer.untouched()) try {
      roll_back.save_what_there_is(step, seconds, before);
    } catch (const Error&) {  // what there is to say is why the step failed
    }
  if (saved() == 0) return Error(fmt::format("{}; no step is saved", problem.what()));
  return Error(fmt::format("{}; {} of {} steps are saved, {}", problem.what(), saved(), step,
                           how_to_go_on(run)));
}

// The training loop from step number `step`; returns the number of steps made, earlier ones
// included. Sets `guard` after the first one, in which kernels may be compiled for long: before it
// there is nothing to save. Then, when its figures are sound, `begin` is called where there is one:
// until then the folder holds another training.
int train_steps(Queue& queue, const TrainConfig& config, const RunFolder& run, Trainer& trainer,
                const Model& model, int step, const Stopwatch& watch, Checkpointer& checkpoints,
                std::optional<InterruptGuard>& guard, bool quiet,
                const std::function<void()>& begin) {
  const ScheduleConfig& plan = config.train;
  Progress progress("train", plan.iterations, quiet, step);
  RollBack roll_back(queue, run, trainer, checkpoints);
  StepFigures figures;
  std::optional<StepFigures> before;
  bool begun = !begin;
  const auto time_is_over = [&] {
    return plan.minutes > 0 && watch.seconds() > 60 * double(plan.minutes);
  };
  for (; step < plan.iterations && !(guard && interrupted()) && !time_is_over(); ++step) {
    try {
      trainer.step(queue, step);
    } catch (const GuidanceFailed& problem) {
      if (guard && interrupted()) break;  // the step has not begun
      progress.finish();
      if (!begun) throw;
      throw without_guidance(problem, step, watch.seconds(), checkpoints, run);
    } catch (const Error& problem) {
      progress.finish();
      if (!is_of_device(problem) || !begun) throw;
      throw without_device(problem, trainer, step, watch.seconds(), roll_back, before, run);
    }
    if (!guard) {
      queue.finish();
      guard.emplace();
    }
    const std::string notice = trainer.take_notice();
    if (!notice.empty()) progress.say("gflow: " + notice);
    const int done = step + 1;
    const bool last = done == plan.iterations, logs = step % plan.log_every == 0 || last;
    const bool saves = !last && ends_round(done, plan.checkpoint_every);
    if (logs || saves) {  // what is saved is looked at before
      figures = trainer.figures(queue);
      if (!is_sound(figures, before.value_or(figures))) {
        if (!begun) throw Error("the loss of the first step is no number");
        std::string sentence;
        step = roll_back.go_back(done, figures, sentence) - 1;
        progress.say("gflow: " + sentence);
        continue;
      }
      before = figures;
      if (!begun) begin();
      begun = true;
    }
    if (logs) try_append_metrics(run, step, watch.seconds(), figures);
    progress.update(done, terms_of(figures));
    if (last) continue;
    if (ends_round(done, plan.save_every)) try_save_model(queue, model, run, done);
    if (saves) checkpoints.try_write(done, watch.seconds());
  }
  queue.finish();
  progress.finish();
  return step;
}

// compare.png: the middle one of the views, beside its truth.
void write_comparison(Queue& queue, Model& model, const TrainConfig& config,
                      const LoadedScene& loaded, const RunFolder& run) {
  const std::vector<RenderView> views =
      split_views(loaded.scene, loaded.scene.test, loaded.frames->cameras(), "test");
  RenderOptions options;
  options.settings = engine_settings(config);
  options.near = config.render.near;
  if (config.scene.background == Background::black) options.background = {0, 0, 0};
  write_png(run.path("compare.png"),
            comparison_picture(queue, model, views[views.size() / 2], *loaded.frames, options));
}

}  // namespace

Evaluation train_run(Queue& queue, const TrainConfig& config, const RunFolder& run, bool quiet,
                     Start start) {
  check(config);
  const bool begins = start != Start::resume || run.checkpoints().steps().empty();
  if (begins) require_first_file(config, run);
  StopSentence stop("interrupted while reading the scene; nothing was lost");
  Preparation prepared(config, run.path("frames"));
  const Scene& scene = prepared.scene();
  if (begins) require_first_points(scene, config.init);
  require_what_judges(config, scene, prepared.frames());
  const std::vector<int> saved = run.checkpoints().steps();
  const bool finished =
      start == Start::resume && !saved.empty() && saved[0] >= config.train.iterations;
  std::unique_ptr<Guidance> guidance = finished ? nullptr : guidance_of(config);
  run.make();
  const FileLock lock = run.lock();
  run.forget_unfinished_files();
  std::optional<CheckpointFolder::Found> resumed;
  if (start == Start::resume) resumed = checkpoint_to_resume(queue, config, scene, run, quiet);
  if (!resumed && start != Start::overwrite) require_no_training(run);
  const bool has_steps_left = !resumed || resumed->checkpoint.facts.step < config.train.iterations;
  if (finished && has_steps_left) guidance = guidance_of(config);  // the last was damaged
  run.forget_stale_caches(cache_stamp(scene, config.scene));
  for (const Frame& frame : scene.test) prepared.frames().rgb(frame);  // broken ones are named now
  prepared.look_for_change();  // a scene may not show what init.from asks for

  // Nothing is wrong with what goes in. Another training stays until the first step of this one is
  // made and sound, which shows that it can be.
  const bool replaces = !resumed && !(run.checkpoints().steps().empty() && run.models().empty());
  if (replaces) require_whole_pictures(scene);
  std::optional<HostModel> first;
  bool begun = false;
  const auto begin_run = [&] {
    begun = true;  // whatever comes of it
    if (!resumed) run.forget_training();
    run.forget_results();
    run.write_config(config);
    run.write_cameras(scene);
    if (first) write_model(run.path("input.ply"), *first);
    first.reset();
  };
  if (!replaces) begin_run();
  const std::string left = replaces ? "the former training is as it was" : how_to_go_on(run);
  stop.say("interrupted while preparing the training; " + left);
  warn_of_idle_settings(scene, config);
  if (!quiet) fmt::print(stderr, "{}", in_words(scene, prepared.frames().cameras()));
  if (prepared.lacks_flow()) stop.say("interrupted while computing optical flow; " + left);
  prepared.compute_flow(run.path("flow"), quiet);

  stop.say("interrupted before the first training step; " + left);
  const auto first_model = [&] {
    first = prepared.first_model(queue);
    if (!replaces) write_model(run.path("input.ply"), *first);
    if (!quiet)
      fmt::print(
          stderr, "{}",
          first_gaussians_in_words(*first, scene, config.init, prepared.began_with_stereo()));
    return Model(queue, *first);
  };
  const auto shape_to_resume = [&] {
    ModelShape shape = model_shape(scene, config);
    if (shape.motion != MotionModelKind::hexplane) return shape;
    const HexplaneShape kept = kept_shape(resumed->checkpoint, resumed->path, run).hexplane;
    shape.hexplane.centre = kept.centre;
    shape.hexplane.half_size = kept.half_size;
    return shape;
  };
  Model model = resumed ? Model(queue, shape_to_resume(), 0) : first_model();
  if (!replaces) first.reset();
  if (!quiet) fmt::print(stderr, "motion model: {}\n", name_of(model.shape.motion));
  Trainer trainer = prepared.trainer(queue, model, guidance.get());
  CheckpointFacts former;
  if (resumed) {
    trainer.set_state(queue, resumed->checkpoint.arrays, resumed->path);
    former = resumed->checkpoint.facts;
    resumed.reset();  // its arrays are as large as the model
    run.keep_metrics_before(former.step);
  }
  Checkpointer checkpoints(queue, config, scene, run, trainer, model.shape);
  const Stopwatch watch(former.seconds);
  std::optional<InterruptGuard> guard;
  int steps = 0;
  try {
    steps = train_steps(queue, config, run, trainer, model, former.step, watch, checkpoints, guard,
                        quiet, begun ? std::function<void()>() : begin_run);
  } catch (const Error& problem) {
    if (begun) throw;
    throw Error(fmt::format("{}; {}", problem.what(), left));
  }
  prepared.flows().prefetch({});  // of steps that an interruption or the clock left out
  if (!guard) guard.emplace();
  if (!begun) begin_run();  // there were no steps to make
  const RunFacts facts{steps,
                       watch.seconds(),
                       peak_memory_mib(),
                       queue.info.full_name(),
                       name_of(model.shape.motion),
                       !interrupted()};
  const int stopped = run.read_facts().iterations;  // where it was gone on from
  save_model(queue, model, run, steps);
  if (stopped != steps && !ends_round(stopped, config.train.save_every)) run.forget_model(stopped);
  run.write_facts(facts);
  checkpoints.write(steps, facts.train_seconds);
  stop.say(
      fmt::format("interrupted while evaluating; the model is in {}, `gflow eval {}` judges it",
                  run.model_path(steps), run.folder()));
  guard.reset();
  if (interrupted())
    throw Interrupted(fmt::format("interrupted after {} of {} steps; the model is in {}, {}", steps,
                                  config.train.iterations, run.model_path(steps),
                                  how_to_go_on(run)));
  if (scene.test.empty()) return {};
  const Evaluation evaluation = judge(queue, model, config, prepared.loaded(), scene.test, quiet,
                                      run.path("test"), run.path("flow"));
  run.write_results(evaluation, "test", facts, config, model.parameters.count);
  write_comparison(queue, model, config, prepared.loaded(), run);
  return evaluation;
}

RunEvaluation evaluate_run(Queue& queue, const RunFolder& run, const std::string& split, bool quiet,
                           int iteration, const std::vector<std::string>& settings) {
  const StopSentence stop("interrupted while evaluating; nothing was lost");
  const auto lock = run.lock_if_free();
  const RunState state = read_run_state(run, iteration);
  const TrainConfig config = judged_by(state.config, run.judged_by(), settings);
  LoadedScene loaded = load_scene(config.scene, run.path("frames"), state.model.shape.origin);
  const std::vector<Frame>& frames = frames_of_split(loaded.scene, split);
  Model model(queue, state.model);
  const bool latest = iteration == latest_iteration || iteration == iterations_of(run).back();
  const bool drawn = lock && latest && split == "test";
  const bool kept = run.has_caches_of(cache_stamp(loaded.scene, config.scene));
  const Evaluation evaluation = judge(queue, model, config, loaded, frames, quiet,
                                      drawn ? run.path("test") : "", kept ? run.path("flow") : "");
  std::vector<std::string> written;
  if (lock)
    written =
        run.write_results(evaluation, split, state.facts, config, model.parameters.count, latest);
  if (drawn) write_comparison(queue, model, config, loaded, run);
  return {evaluation, state.text(), written};
}

}  // namespace gflow
