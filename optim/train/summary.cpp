// SPDX-License-Identifier: Apache-2.0
#include "optim/train/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "optim/init/init.hpp"
#include "optim/objectives/image_objective.hpp"
#include "optim/scene/depths.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Whether the first Gaussian, which is never short-lived, is at one of the scene's points; random
// ones are not.
bool lies_on_points(const HostModel& model, const Scene& scene) {
  const std::vector<float>& means = model.groups.at("means");
  for (size_t i = 0; i < scene.points.size(); ++i)
    if (std::equal(means.begin(), means.begin() + 3, &scene.points.xyz[3 * i],
                   [](float mean, double point) { return mean == float(point); }))
      return true;
  return false;
}

// Number of Gaussians with a shorter lifetime than the first one.
size_t count_short_lived(const HostModel& model) {
  const std::vector<float>& log_scales = model.groups.at("log_scales");
  size_t count = 0;
  for (size_t i = 0; i < model.count; ++i) count += log_scales[4 * i + 3] < log_scales[3];
  return count;
}

std::string place_of(const HostModel& model, const Scene& scene, const InitOptions& init,
                     const char* place_of_points) {
  if (init.begins_from_file()) return "from " + init.file;
  if (lies_on_points(model, scene)) return place_of_points;
  const bool hull = scene.has_alpha && init.from != InitFrom::random;
  return hull ? "in the visual hull" : "at random positions";
}

std::string count_of(size_t count, const char* one, const char* several) {
  return fmt::format("{} {}", count, count == 1 ? one : several);
}

}  // namespace

std::string in_words(const Scene& scene, const std::vector<Camera>& cameras) {
  std::set<std::pair<int, int>> sizes;
  for (const Camera& camera : cameras) sizes.insert({camera.width, camera.height});
  std::string text =
      fmt::format("scene: {}, {}, {}; images: {} training, {} test, {} validation, {}{}x{}\n",
                  scene.layout, count_of(scene.cameras.size(), "camera", "cameras"),
                  count_of(size_t(scene.steps), "time step", "time steps"), scene.train.size(),
                  scene.test.size(), scene.val.size(), sizes.size() > 1 ? "up to " : "",
                  sizes.rbegin()->first, sizes.rbegin()->second);
  const auto& [x, y, z] = scene.origin;
  if (x != 0 || y != 0 || z != 0)
    text += fmt::format("coordinates: relative to ({}, {}, {}) of the scene's world\n", x, y, z);
  if (!scene.test.empty() && are_training_images(scene, scene.test))
    text += "test views: same as the training views; their metrics do not measure novel views\n";
  return text;
}

std::string first_gaussians_in_words(const HostModel& model, const Scene& scene,
                                     const InitOptions& init, const char* place_of_points) {
  if (const size_t moving = model.num_moving(); moving < model.count)
    return fmt::format("initial Gaussians: {} of what rests, {} of what moves\n",
                       model.count - moving, moving);
  const size_t short_lived = count_short_lived(model);
  const std::string more =
      short_lived ? fmt::format(", and {} short-lived ones where there is motion", short_lived)
                  : "";
  return fmt::format("initial Gaussians: {} {}{}\n", model.count - short_lived,
                     place_of(model, scene, init, place_of_points), more);
}

// Basketball, 810 images: used 12 times each 27.9 dB, 25 times 28.6 dB.
std::string steps_in_words(const Scene& scene, const ScheduleOptions& schedule) {
  constexpr double enough = 25, many = 30000, worth_it = 1.5;
  const double images = double(scene.train.size());
  const double views = double(schedule.iterations) * double(schedule.batch);
  const double better = std::min(enough * images / double(schedule.batch), many);
  const bool draft = schedule.iterations < ScheduleOptions{}.iterations;
  if (draft || better < worth_it * double(schedule.iterations)) return "";
  return fmt::format(
      "steps: {} use each of the {} training images {:.2g} times; --iterations {:.0f} would show "
      "more detail\n",
      schedule.iterations, scene.train.size(), views / images, std::round(better / 1000) * 1000);
}

std::string colors_in_words(const Scene& scene, const TrainOptions& config) {
  if (!have_own_colors(config.loss.camera_color, scene)) return "";
  return "colours: each training camera has its own exposure and white balance; other views are "
         "drawn with their mean (loss.camera_color)\n";
}

void warn_of_idle_settings(const Scene& scene, const TrainOptions& config) {
  if (!config.scene.cameras.empty() && !takes_cameras(scene.layout))
    warn(fmt::format("scene.cameras = \"{}\" has no effect: scene '{}' has its own cameras ({})",
                     config.scene.cameras, scene.name, scene.layout));
  const MotionModelKind model = motion_model(scene, config);
  const MotionModel& traits = motion_model_of(model);
  const char* const name = traits.name;
  if (config.motion.keys > 0 && !has_number(traits, "keys"))
    warn(fmt::format("motion.keys = {} has no effect: motion model {} has no keys",
                     config.motion.keys, name));
  if (config.motion.key_scales && !has_number(traits, "key_scales"))
    warn(fmt::format("motion.key_scales has no effect with motion model {}, only with keyframes",
                     name));
  if (config.motion.static_threshold > 0 && traits.is_permanent)
    warn(
        fmt::format("motion.static_threshold = {} has no effect: motion model {} has no motion "
                    "parameters per Gaussian",
                    config.motion.static_threshold, name));
  else if (config.motion.static_threshold > 0 && config.train.sequential)
    warn(
        fmt::format("motion.static_threshold = {} has no effect with train.sequential: static "
                    "Gaussians are unknown until the last time step is trained",
                    config.motion.static_threshold));
  const float near = near_or_default(config.render.near, scene);
  if (const double share = share_of_points_nearer(scene, double(near)); share > 0.01)
    warn(
        fmt::format("render.near = {:.3g}: {:.0f} % of the points that a training camera sees are "
                    "nearer, so it cannot see Gaussians there",
                    near, 100 * share));
  const bool masked = std::any_of(scene.train.begin(), scene.train.end(),
                                  [](const Frame& frame) { return !frame.mask_path.empty(); });
  if (config.scene.masks == Masks::foreground && !masked)
    warn("scene.masks = \"foreground\" has no effect: no training image has a mask");
  if (config.loss.foreground != LossOptions{}.foreground && config.scene.masks != Masks::foreground)
    warn(fmt::format("loss.foreground = {:g} has no effect without scene.masks = \"foreground\"",
                     config.loss.foreground));
  if (config.train.validate_every != ScheduleOptions{}.validate_every && scene.val.empty())
    warn(
        fmt::format("train.validate_every = {} has no effect: the scene has no validation views; "
                    "scene.val_every holds some back",
                    config.train.validate_every));
  const FlowOptions& flow = config.flow;
  const bool asks_tracks =
      flow.source == FlowSource::tracks || (flow.long_span == FarFlow::tracks && flow.span != 1);
  if (!flow.tracks.empty() && !asks_tracks)
    warn(
        fmt::format("flow.tracks = \"{}\" has no effect: set flow.source = \"tracks\", or "
                    "flow.long_span = \"tracks\" and flow.span other than 1",
                    flow.tracks));
  const GuidanceOptions& guidance = config.guidance;
  for (const auto& [setting, value] : {std::pair{"command", &guidance.command},
                                       {"model", &guidance.model},
                                       {"images", &guidance.images}})
    if (!guidance.enabled() && !value->empty())
      warn(fmt::format("guidance.{} = \"{}\" has no effect: guidance.provider is none", setting,
                       *value));
  if (!config.density.enabled && !config.init.begins_from_file())
    warn(
        "density.enabled = false without --init FILE: training keeps the initial number of "
        "Gaussians and adds none where the scene needs more");
}

}  // namespace gflow
