// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/evaluate_run.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "optim/eval/metric_networks.hpp"
#include "optim/eval/rendering.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/runs/replacement.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/move_cameras.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/progress.hpp"

namespace gflow {
namespace {

// The settings of a run with some of [metrics] changed; Error for any other. Networks of the
// previous evaluation are used again unless the settings name others.
TrainOptions evaluation_options(const TrainOptions& config, const MetricsOptions& before,
                                const std::vector<std::string>& settings) {
  TrainOptions changed = config;
  const auto keep = [](std::string& network, const std::string& former) {
    if (network.empty() && std::filesystem::exists(former)) network = former;
  };
  keep(changed.metrics.lpips, before.lpips);
  keep(changed.metrics.clip, before.clip);
  for (const std::string& setting : settings) {
    apply_setting(changed, setting);
    TrainOptions rest = changed;
    rest.metrics = config.metrics;
    if (setting_values(rest) != setting_values(config))
      throw Error(
          fmt::format("--set {}: a run is evaluated with the settings it was trained with; only "
                      "[metrics] settings can be changed",
                      setting));
  }
  if (!settings.empty()) make_paths_absolute(changed.metrics);
  return changed;
}

// The image of the first time step, if one camera at a time films the scene; else nullptr.
const Frame* first_view_alone(const Scene& scene) {
  if (scene.train.size() >= 2 * size_t(scene.steps)) return nullptr;
  const auto first =
      std::min_element(scene.train.begin(), scene.train.end(),
                       [](const Frame& a, const Frame& b) { return a.step < b.step; });
  return first->step == 0 ? &*first : nullptr;
}

}  // namespace

Evaluation evaluate_views(Queue& queue, Model& model, const TrainOptions& config,
                          const LoadedScene& loaded, const std::vector<Frame>& frames, bool quiet,
                          const std::string& image_folder, const std::string& flow) {
  if (!image_folder.empty()) std::filesystem::create_directories(image_folder);
  Progress progress("eval ", long(frames.size()), quiet);
  Evaluation evaluation = evaluate(queue, model, config, loaded, frames,
                                   progress_callback(progress), image_folder, flow);
  progress.finish();
  if (!loaded.scene.tracks_path.empty()) {
    Tracks tracks = read_tracks(loaded.scene.tracks_path, loaded.scene.origin);
    mark_seen(tracks, loaded.scene, *loaded.frames);
    evaluation.tracks = track_error(queue, model, tracks);
    if (const Frame* first = first_view_alone(loaded.scene))
      evaluation.tracks->from_view =
          track_error_from_view(queue, model, tracks, loaded.frames->camera(*first),
                                near_or_default(config.render.near, loaded.scene));
  }
  return evaluation;
}

void require_metric_networks(const TrainOptions& config, const Scene& scene,
                             const FrameStore& frames) {
  const MetricNetworks networks(config.metrics);
  for (const Frame& frame : scene.test) {
    const Camera& camera = frames.camera(frame);
    networks.require_size(camera.width, camera.height);
    if (has_true_depth(frame, config.scene))
      read_depth_map(frame, scene.cameras[size_t(frame.camera)], camera.width, camera.height,
                     config.scene);
  }
  if (!scene.tracks_path.empty()) read_tracks(scene.tracks_path, scene.origin);
}

void write_comparison(Queue& queue, Model& model, const TrainOptions& config,
                      const LoadedScene& loaded, const std::vector<Frame>& frames,
                      const RunFolder& run) {
  const std::vector<RenderView> views =
      split_views(loaded.scene, frames, loaded.frames->cameras(), "test");
  RenderOptions options;
  options.settings = engine_settings(config);
  options.near = near_or_default(config.render.near, loaded.scene);
  if (config.scene.background == Background::black) options.background = {0, 0, 0};
  write_png(run.path("compare.png"),
            comparison_image(queue, model, views[views.size() / 2], *loaded.frames, options));
}

RunEvaluation evaluate_run(Queue& queue, const RunFolder& run, const std::string& split, bool quiet,
                           int iteration, const std::vector<std::string>& settings) {
  const StopSentence stop("interrupted while evaluating; nothing was lost");
  const auto lock = run.lock_if_free();
  if (lock) complete_replacement(run, *lock);
  const RunState state = read_run_state(run, iteration);
  const TrainOptions config = evaluation_options(state.config, run.metrics_options(), settings);
  LoadedScene loaded = load_scene(config.scene, run.path("frames"), state.model.shape.origin);
  if (refines_cameras(config.cameras, loaded.scene)) {
    run.move_cameras(*loaded.frames);
    undo_fits(loaded.scene, *loaded.frames);
  }
  const std::vector<Frame>& frames = frames_of_split(loaded.scene, split);
  Model model(queue, state.model, Purpose::rendering);
  const bool latest = iteration == latest_iteration || iteration == iterations_of(run).back();
  const bool drawn = lock && latest && split == "test";
  const bool kept = run.has_caches_of(cache_stamp(loaded.scene, config.scene));
  const Evaluation evaluation =
      evaluate_views(queue, model, config, loaded, frames, quiet, drawn ? run.path("test") : "",
                     kept ? run.path("flow") : "");
  if (drawn) write_comparison(queue, model, config, loaded, frames, run);
  std::vector<std::string> written;
  if (lock)
    written =
        run.write_results(evaluation, split, state.facts, config, model.parameters.count, latest);
  return {evaluation, state.text(), state.facts, written};
}

}  // namespace gflow
