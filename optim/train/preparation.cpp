// SPDX-License-Identifier: Apache-2.0
#include "optim/train/preparation.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/cameras/camera_moves.hpp"
#include "optim/cameras/correct_cameras.hpp"
#include "optim/density/memory.hpp"
#include "optim/flow/chained_flow.hpp"
#include "optim/flow/estimated_flow.hpp"
#include "optim/flow/point_tracks.hpp"
#include "optim/init/depth_points.hpp"
#include "optim/init/init.hpp"
#include "optim/init/stereo_points.hpp"
#include "optim/movers/first_model.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/objectives/depth_objective.hpp"
#include "optim/options/scene_defaults.hpp"
#include "optim/scene/depths.hpp"
#include "optim/train/guidance_provider.hpp"
#include "optim/train/poor_scene.hpp"
#include "optim/train/summary.hpp"
#include "optim/train/train.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Neighbours in time at most max_gap steps apart: flow over more is unreliable.
std::vector<FlowPair> close_pairs(const Scene& scene, const FlowOptions& flow) {
  const bool by_track = flow.pairs == FlowPairs::track;
  if (!by_track && flow.source != FlowSource::files)
    throw Error(
        "flow.pairs = \"time\" compares images of different cameras, for which flow is not "
        "computed: set flow.source = \"files\" and flow.folder");
  std::vector<FlowPair> close;
  for (const FlowPair& pair : by_track ? neighbour_pairs(scene) : pairs_in_time(scene))
    if (pair.next < 0 ||
        scene.train[size_t(pair.next)].step - scene.train[size_t(pair.frame)].step <= flow.max_gap)
      close.push_back(pair);
  return close;
}

// Pairs further apart: over 2, 4, 8, ... frames and over `reach` itself, in both directions.
std::vector<FlowPair> far_pairs(const Scene& scene, const FlowOptions& flow) {
  std::vector<FlowPair> pairs;
  if (flow.span == 1) return pairs;
  const int most = flow.span > 0 ? flow.span : int(scene.train.size());
  for (int span = 2;; span = std::min(2 * span, most)) {
    const std::vector<FlowPair> apart = distant_pairs(scene, span);
    for (const FlowPair& pair : apart)
      if (scene.train[size_t(pair.next)].step - scene.train[size_t(pair.frame)].step <=
          span * flow.max_gap)
        pairs.push_back(pair);
    if (apart.empty() || span >= most) break;
  }
  if (flow.backward)
    for (const FlowPair& pair : reversed(pairs)) pairs.push_back(pair);
  return pairs;
}

// Chains the flow of neighbours, the first of `pairs`, to the flow of all pairs.
FlowStore with_far_flow(const TrainOptions& config, const LoadedScene& loaded,
                        const std::vector<FlowPair>& pairs, FlowStore neighbours,
                        const StoreFlow& keep = {}) {
  if (neighbours.size() == pairs.size()) return neighbours;
  const auto near = std::make_shared<FlowStore>(std::move(neighbours));
  return extended(
      near, config.flow.long_span == FarFlow::tracks
                ? track_flows(loaded.scene, pairs, near->size(), *loaded.frames, config.flow.tracks)
                : chained_flows(near, pairs, keep));
}

// Error if two settings of flow contradict each other.
void require_sources(const FlowOptions& flow) {
  const bool by_tracks =
      flow.source == FlowSource::tracks || (flow.span != 1 && flow.long_span == FarFlow::tracks);
  if (!flow.enabled) return;
  if (flow.span != 1 && flow.pairs == FlowPairs::time)
    throw Error("flow.span above 1 follows the images of one camera: set flow.pairs = \"track\"");
  if (by_tracks && flow.tracks.empty())
    throw Error("flow.tracks is empty: flow from point tracks needs a file or folder of tracks");
  if (flow.span != 1 && flow.long_span == FarFlow::direct && flow.source != FlowSource::dis)
    throw Error(
        fmt::format("flow.long_span = \"direct\" computes flow from images, but flow.source is "
                    "\"{}\": choose \"chain\" or \"tracks\"",
                    name_of(flow.source)));
}

// The flow that is available without computing it: none, or that of files.
std::optional<FlowStore> flows_at_hand(const TrainOptions& config, const LoadedScene& loaded,
                                       const std::vector<FlowPair>& pairs) {
  if (!config.flow.enabled || pairs.empty())
    return FlowStore(std::vector<FlowStore::Loader>(pairs.size()));
  if (config.flow.source == FlowSource::tracks)
    return FlowStore(track_flows(loaded.scene, pairs, 0, *loaded.frames, config.flow.tracks));
  if (config.flow.source != FlowSource::files) return {};
  if (!config.flow.folder.empty())
    return flows_from_folder(loaded.scene, pairs, *loaded.frames, config.flow.folder);
  FlowStore flows = true_flows(loaded.scene, pairs, *loaded.frames);
  bool any = false;
  for (size_t i = 0; i < pairs.size(); ++i) any |= flows.has(i);
  if (!any)
    throw Error(
        fmt::format("flow.source is \"files\", but scene '{}' has no ground-truth flow between "
                    "training images that are compared: set flow.folder to a folder of flow files",
                    loaded.scene.name));
  return flows;
}

FlowEstimation kept_in(const std::string& folder, const FlowOptions& flow) {
  FlowEstimation how;
  how.folder = folder;
  how.budget = uint64_t(double(flow.store) * double(uint64_t{1} << 30));
  how.notice = warn;
  return how;
}

FlowStore computed_flows(const TrainOptions& config, const LoadedScene& loaded,
                         const std::vector<FlowPair>& pairs, FlowEstimation how, bool quiet) {
  const size_t compared = num_compared(pairs);
  const size_t views = size_t(config.train.iterations) * size_t(config.train.batch);
  how.beforehand =
      compared <= views && likely_flow_bytes(loaded.scene, pairs, *loaded.frames) <= how.budget;
  if (!how.beforehand && !quiet)
    print_status(
        "optical flow of {} image pairs is computed on demand and cached, up to {} GiB, in {}\n",
        compared, config.flow.store, how.folder);
  Progress progress("flow ", long(compared), quiet || !how.beforehand || compared == 0);
  how.progress = [&progress, report = how.progress](size_t done, size_t total) {
    progress.update(long(done));
    if (report) report(done, total);
  };
  FlowStore flows = estimated_flows(loaded.scene, pairs, *loaded.frames, how);
  progress.finish();
  return flows;
}

// Where what rests and the paths of what moves are known before the first step, training few frames
// first would gain nothing, and large steps of the field would lose the paths. A hand moves a
// camera little compared with the size of what it films, so splits and steps follow the depth where
// the extent is smaller. More than one step on what moves for each on a whole image fits it to
// single images.
TrainOptions with_scene_known(TrainOptions config, const Scene& scene) {
  if (!begins_with_background(scene, config)) return config;
  config.cameras.start = 0;
  config.motion.hexplane.warmup = 0;
  config.motion.hexplane.curriculum = 0;
  config.train.focus = std::min(config.train.focus, 1);
  const float deep = float(size_of_scene(scene) / scene.extent);
  LearningRateOptions& lr = config.lr;
  for (float* of_extent :
       {&config.density.split_scale, &lr.means, &lr.means_final, &config.motion.hexplane.means})
    *of_extent *= deep;
  for (float* rate : {&lr.planes, &lr.planes_final, &lr.network, &lr.network_final}) *rate *= 0.1f;
  return config;
}

// A video without poses is trained as that of a static camera.
void warn_of_moving_camera(const TrainOptions& config, const LoadedScene& loaded) {
  const Scene& scene = loaded.scene;
  if (!takes_cameras(scene.layout) || !config.scene.cameras.empty() || scene.has_alpha) return;
  if (config.scene.still) return;
  if (camera_moves(scene.train, *loaded.frames))
    warn(fmt::format(
        "the camera seems to move, but is trained as a static one: `gflow cameras {} -o SCENE` "
        "finds its poses and writes a scene to train on",
        scene.folder));
}

}  // namespace

Preparation::Preparation(const TrainOptions& config, const std::string& unpack_folder)
    : Preparation(config, load_scene(config.scene, unpack_folder)) {}

Preparation::Preparation(const TrainOptions& config, LoadedScene loaded)
    : loaded_(std::move(loaded)),
      config_(with_scene_known(with_scene_defaults(config, loaded_.scene), loaded_.scene)) {
  if (scene().train.empty()) throw Error("scene '" + scene().name + "' has no training views");
  require_sequence(config, scene(), model_shape(scene(), config));
  require_guided_views(config, scene());
  require_depth(config, scene(), frames());
  require_sources(config.flow);
  neighbours_ = close_pairs(scene(), config.flow);
  if (config.flow.backward)
    for (const FlowPair& pair : reversed(neighbours_)) neighbours_.push_back(pair);
  pairs_ = neighbours_;
  for (const FlowPair& pair : far_pairs(scene(), config.flow)) pairs_.push_back(pair);
  const bool all_alike = !config.flow.enabled || config.flow.source == FlowSource::tracks;
  flows_ = flows_at_hand(config, loaded_, all_alike ? pairs_ : neighbours_);
  if (flows_) flows_ = with_far_flow(config, loaded_, pairs_, std::move(*flows_));
  warn_of_idle_settings(scene(), config);
}

void Preparation::compute_flow(const std::string& folder, bool quiet,
                               const ProgressCallback& progress) {
  if (flows_) return;
  const bool all_alike = config_.flow.long_span == FarFlow::direct;
  FlowEstimation how = kept_in(folder, config_.flow);
  how.progress = progress;
  flows_ =
      with_far_flow(config_, loaded_, pairs_,
                    computed_flows(config_, loaded_, all_alike ? pairs_ : neighbours_, how, quiet),
                    stored_flows(scene(), frames(), how));
}

void Preparation::find_motion_masks() {
  warn_of_poor_scene(scene(), frames());
  warn_of_moving_camera(config_, loaded_);
  if (config_.init.dynamic > 0 || config_.train.focus > 0)
    static_cameras_ = static_cameras_of(scene(), frames());
  parts_ = parts_of_interest(scene(), frames(), static_cameras_);
}

HostModel Preparation::first_model(Queue& queue, bool quiet) {
  if (begins_with_background(scene(), config_)) {
    if (auto model = model_of_moving_camera(queue, quiet)) return *std::move(model);
    warn(
        "hardly anything in the images is at rest for these cameras, so training begins as if all "
        "moved: check the poses (cameras.refine = on corrects some degrees) and the order of the "
        "images");
  }
  const InitFrom from = config_.init.from;
  const bool has_none =
      scene().points.size() == 0 && !scene().has_alpha && config_.init.file.empty();
  const bool free = from == InitFrom::automatic && has_none;
  const bool has_depth = config_.loss.depth > 0 && has_metric_depth(scene(), config_.scene);
  if (from == InitFrom::depth || (free && has_depth))
    loaded_.scene.points = points_from_depth();
  else if (from == InitFrom::stereo || free)
    loaded_.scene.points = points_from_stereo();
  const Model none(queue, model_shape(scene(), config_), 0);
  const size_t holds = most_gaussians(queue.info, none.parameters, size_t(config_.density.memory),
                                      config_.adam.beta1 > 0);
  TrainOptions config = config_;
  if (holds < size_t(config.density.cap)) {
    warn(
        fmt::format("density.memory and the largest allocation ({:.1f} MiB on {}) fit only {} "
                    "Gaussians: density.cap = {} will not be reached",
                    double(queue.info.max_allocation) / (1 << 20), queue.info.full_name(), holds,
                    config.density.cap));
    config.density.cap = std::max(int(holds), 1);
  }
  return initial_model(scene(), frames(), parts_, static_cameras_, neighbours_, *flows_, config);
}

std::optional<HostModel> Preparation::model_of_moving_camera(Queue& queue, bool quiet) {
  std::optional<Progress> progress;
  const auto begin = [&](const char* stage, size_t total) {
    progress.emplace(stage, long(total), quiet);
    return progress_callback(*progress);
  };
  const TrainModel train_still = [&](Scene still, const TrainOptions& options,
                                     const ProgressCallback& report) {
    StepCounter counter(report, size_t(options.train.iterations));
    return train(queue, std::move(still), options, {&counter, {}}).model;
  };
  if (refines_cameras(config_.cameras, scene()) && !scene().estimated_cameras) {
    const auto turn = correct_cameras(scene(), frames(), begin("cameras", scene().train.size()));
    progress.reset();
    if (turn && !quiet)
      print_status(
          "cameras corrected by {:.2g} degrees on average, to agree with what is at rest\n", *turn);
  }
  auto moving = moving_scene(queue, scene(), frames(), config_, train_still, begin);
  if (!moving) return std::nullopt;
  set_motion_masks(std::move(moving->masks));
  return std::move(moving->model);
}

void Preparation::set_motion_masks(MotionMasks masks) {
  motion_masks_ = std::move(masks);
  if (!motion_masks_.empty()) parts_ = parts_around(scene(), frames(), motion_masks_);
}

PointCloud Preparation::points_from_depth() {
  PointCloud points = depth_points(scene(), frames(), config_.scene, size_t(config_.init.count),
                                   uint32_t(config_.train.seed));
  if (points.size() == 0)
    throw Error(
        fmt::format("the first Gaussians are to lie at the depths of images, but no training image "
                    "of scene '{}' has a metric depth file with depths: choose another init.from",
                    scene().name));
  place_of_points_ = "at the depths of images";
  return points;
}

PointCloud Preparation::points_from_stereo() {
  if (static_cameras_.empty()) static_cameras_ = static_cameras_of(scene(), frames());
  PointCloud points = stereo_points(scene(), frames(), static_cameras_, size_t(config_.init.count),
                                    uint32_t(config_.train.seed));
  constexpr size_t few = 100;
  if (points.size() >= few) {
    place_of_points_ = "at points matched between cameras";
    return points;
  }
  if (config_.init.from == InitFrom::stereo)
    throw Error(
        fmt::format("init.from is \"stereo\", but scene '{}' has only {} points that look alike in "
                    "two cameras: choose random",
                    scene().name, points.size()));
  return {};
}

Trainer Preparation::trainer(Queue& queue, Model& model, Guidance* guidance,
                             const std::vector<MakeObjective>& more) {
  return Trainer({queue, config_, scene(), frames(), pairs_, *flows_, model, guidance}, parts_,
                 more);
}

}  // namespace gflow
