// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/first_model.hpp"

#include <algorithm>
#include <cmath>

#include "optim/init/init.hpp"
#include "optim/movers/follow_paths.hpp"
#include "optim/options/scene_defaults.hpp"
#include "shared/sh.h"

namespace gflow {
namespace {

constexpr size_t kLeastAtRest = 500;      // points; of a usual video there are thousands
constexpr double kBackgroundShare = 0.7;  // of density.cap
constexpr float kOpacity = 0.8f;          // of Gaussians on paths
constexpr float kSize = 0.7f;             // standard deviation, of the distance between paths

const char* const kRows[] = {"means",           "means_t", "quats",  "log_scales",
                             "logit_opacities", "sh0",     "sh_rest"};

// Appends a Gaussian per path, where it is in the middle of the video, or when it was chosen if
// Gaussians of the motion model have motion of their own.
void append_paths(HostModel& model, const Paths& paths) {
  const bool permanent = is_permanent(model.shape.motion);
  const float duration = model.shape.duration;
  const float lifetime = duration * (permanent ? 1000 : kPathLifetime);
  HostGroups& g = model.groups;
  const auto append = [&](const char* name, std::initializer_list<float> values) {
    g[name].insert(g[name].end(), values);
  };
  for (size_t i = 0; i < paths.count(); ++i) {
    const size_t frame = permanent ? paths.frames() / 2 : size_t(paths.first_seen[i]);
    const float* at = paths.at(i, frame);
    const float size = std::log(kSize * paths.size[i]);
    append("means", {at[0], at[1], at[2]});
    append("means_t", {duration * float(paths.times[frame])});
    append("quats", {1, 0, 0, 0});
    append("log_scales", {size, size, size, std::log(lifetime)});
    append("logit_opacities", {std::log(kOpacity / (1 - kOpacity))});
    for (size_t c = 0; c < 3; ++c)
      append("sh0", {(float(paths.rgb[3 * i + c]) / 255 - 0.5f) / float(SH_C0)});
  }
  model.count = model.moving = paths.count();
  g["sh_rest"].resize(model.count * 3 *
                      size_t((model.shape.sh_degree + 1) * (model.shape.sh_degree + 1) - 1));
}

void append_background(HostModel& model, const HostModel& background) {
  for (const char* name : kRows) {
    const std::vector<float>& from = background.groups.at(name);
    std::vector<float>& to = model.groups[name];
    to.insert(to.end(), from.begin(), from.end());
  }
  const float duration = model.shape.duration;
  for (size_t i = model.count; i < model.count + background.count; ++i) {
    model.groups["means_t"][i] = duration / 2;
    model.groups["log_scales"][4 * i + 3] = std::log(1000 * duration);
  }
  model.count += background.count;
}

}  // namespace

std::optional<MovingScene> moving_scene(Queue& queue, const Scene& scene, FrameStore& store,
                                        const TrainOptions& options, const TrainModel& train,
                                        const BeginStage& begin) {
  TrainOptions config = with_scene_defaults(options, scene);
  const size_t cap = size_t(config.density.cap);
  config.density.cap = int(kBackgroundShare * double(cap));
  const SmallVideo video = small_video(scene, store);
  const Suspects suspects =
      suspects_of(video, {size_t(config.init.count)}, begin("motion", video.size()));
  if (suspects.points.size() < kLeastAtRest) return std::nullopt;
  const StillBackground background =
      background_of(queue, scene, store, video, suspects, config, train,
                    begin("background", size_t(config.init.background)));
  const NeighbourFlows flows = neighbour_flows(video);
  const std::vector<Mover> movers = movers_of(video, background, flows);
  const Paths paths =
      paths_of(video, movers, flows, std::min(size_t(config.init.dynamic), cap / 5));
  HostModel model;
  model.shape = model_shape(scene, options);
  append_paths(model, paths);
  enclose(model.shape, paths.count() ? model.groups["means"] : background.model.groups.at("means"),
          options.motion);
  append_background(model, background.model);
  set_static(model.shape, model.groups, model.count, uint32_t(options.train.seed));
  if (const auto place = motion_model_of(model.shape.motion).place)
    place(model.shape, model.groups, 0, model.moving);
  if (paths.count() > 0)
    follow_paths(queue, model, paths, scene, options, begin("paths", kStepsOnPaths));
  MotionMasks masks;
  for (size_t i = 0; i < video.size(); ++i)
    masks.emplace_back(video.frames[i]->name, background.moving[i]);
  return MovingScene{std::move(model), std::move(masks)};
}

}  // namespace gflow
