// SPDX-License-Identifier: Apache-2.0
#include "optim/train/make_objectives.hpp"

#include "optim/objectives/camera_objective.hpp"
#include "optim/objectives/depth_objective.hpp"
#include "optim/objectives/flow_objective.hpp"
#include "optim/objectives/guidance_objective.hpp"
#include "optim/objectives/image_objective.hpp"
#include "optim/objectives/motion_objective.hpp"

namespace gflow {
namespace {

std::unique_ptr<Objective> image(const TrainInputs& in) {
  std::optional<CameraColorRule> colors;
  if (have_own_colors(in.options.loss.camera_color, in.scene))
    colors = {in.options.lr.camera_color, in.options.loss.camera_color_shrink};
  return std::make_unique<ImageObjective>(in.queue, in.scene, in.frames, in.options.loss.ssim,
                                          in.options.loss.foreground, colors);
}

std::unique_ptr<Objective> flow(const TrainInputs& in) {
  return std::make_unique<FlowObjective>(in.queue, in.options, in.scene, in.frames, in.pairs,
                                         in.flows, in.model.shape.motion);
}

std::unique_ptr<Objective> depth(const TrainInputs& in) {
  if (!(in.options.loss.depth > 0)) return nullptr;
  return std::make_unique<DepthObjective>(in.queue, in.options, in.scene, in.frames);
}

std::unique_ptr<Objective> cameras(const TrainInputs& in) {
  if (!refines_cameras(in.options.cameras, in.scene)) return nullptr;
  return std::make_unique<CameraObjective>(in.queue, in.options, in.scene, in.frames, in.pairs);
}

std::unique_ptr<Objective> motion(const TrainInputs& in) {
  return MotionObjective::make(in.queue, in.options.loss, in.scene.steps, float(in.scene.extent),
                               in.model);
}

std::unique_ptr<Objective> guidance(const TrainInputs& in) {
  if (!in.guidance) return nullptr;
  return std::make_unique<GuidanceObjective>(in.queue, in.options, in.scene, in.frames,
                                             *in.guidance);
}

// Order of their terms in log and CSV. The image objective is first, because it sets what others
// add to; that of the cameras comes before those that add gradients of poses. A new objective is
// one more function above and one more name here.
constexpr std::unique_ptr<Objective> (*kObjectives[])(const TrainInputs&) = {
    image, flow, depth, cameras, motion, guidance};

}  // namespace

std::vector<std::unique_ptr<Objective>> make_objectives(const TrainInputs& inputs,
                                                        const std::vector<MakeObjective>& more) {
  std::vector<std::unique_ptr<Objective>> objectives;
  for (const auto make : kObjectives)
    if (auto objective = make(inputs)) objectives.push_back(std::move(objective));
  for (const MakeObjective& make : more)
    if (auto objective = make(inputs)) objectives.push_back(std::move(objective));
  return objectives;
}

}  // namespace gflow
