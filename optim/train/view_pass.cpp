// SPDX-License-Identifier: Apache-2.0
#include "optim/train/view_pass.hpp"

#include <algorithm>

#include "optim/objectives/crop.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

ViewPass::ViewPass(Queue& queue, const EngineSettings& settings, float near, int time_steps,
                   FrameStore& frames, Model& model,
                   std::vector<std::unique_ptr<Objective>> objectives)
    : near_(near),
      time_steps_(time_steps),
      frames_(frames),
      model_(model),
      renderer_(queue, settings),
      objectives_(std::move(objectives)) {}

void ViewPass::begin_step(Queue& queue, const StepContext& context) {
  for (const auto& objective : objectives_) objective->begin_step(queue, context);
}

void ViewPass::run_novel_views(Queue& queue, const StepContext& context,
                               const std::function<void(const Shot&)>& after_backward) {
  NovelViews views{queue, model_, renderer_, after_backward};
  for (const auto& objective : objectives_) objective->add_novel_views(views, context);
}

ViewContext ViewPass::context_of(const StepContext& context, const Sample& sample,
                                 int in_batch) const {
  const Camera& camera = frames_.camera(*sample.frame);
  ViewContext view;
  static_cast<StepContext&>(view) = context;
  view.in_batch = in_batch;
  view.sample = sample;
  view.width = camera.width;
  view.height = camera.height;
  const double pixels = double(size_t(sample.part.width) * size_t(sample.part.height));
  view.share = float(pixels / (double(camera.width) * camera.height));
  return view;
}

Shot ViewPass::shot_of(const ViewContext& view) const {
  Shot shot;
  shot.view.camera = crop(pinhole(frames_.camera(*view.sample.frame), near_), view.sample.part);
  shot.view.camera_t2 = shot.view.camera;
  shot.time = view.sample.frame->time;
  // Second time of losses that compare poses: the next time step, or the one before.
  const double later = shot.time + 1.0 / std::max(time_steps_ - 1, 1);
  shot.time_t2 = later < 1 + 1e-6 ? later : 2 * shot.time - later;
  shot.sh_degree = view.sh_degree;
  for (size_t c = 0; c < 3; ++c) shot.background[c] = float(view.background[c]) / 255;
  return shot;
}

Shot ViewPass::compare(Queue& queue, const ViewContext& view, bool all_posed) {
  Shot shot = shot_of(view);
  shot.all_posed = all_posed;
  for (const auto& objective : objectives_) objective->request(queue, view, shot);
  renderer_.forward(queue, model_, shot);
  v_.zero(queue, renderer_.images(), shot.flow, shot.depth);
  for (const auto& objective : objectives_) objective->add_gradients(queue, view, renderer_, v_);
  renderer_.backward_to_poses(queue, v_);
  return shot;
}

void ViewPass::add_to_parameters(Queue& queue, const ViewContext& view, GaussianGradients& poses,
                                 size_t intersections) {
  empty_views_ = intersections > 0 ? 0 : empty_views_ + 1;
  for (const auto& objective : objectives_)
    objective->add_pose_gradients(queue, view, renderer_, poses);
  renderer_.backward_to_parameters(queue, model_);
}

void ViewPass::run(Queue& queue, const StepContext& context, const Sample& sample, int in_batch,
                   bool all_posed) {
  const ViewContext view = context_of(context, sample, in_batch);
  compare(queue, view, all_posed);
  add_to_parameters(queue, view, renderer_.gradients(), renderer_.engine().tiles().intersections);
}

ViewRecord ViewPass::render(Queue& queue, const StepContext& context, const Sample& sample,
                            int in_batch, bool all_posed) {
  const ViewContext view = context_of(context, sample, in_batch);
  const Shot shot = compare(queue, view, all_posed);
  ViewRecord record = record_of(queue, renderer_, model_, shot);
  for (const auto& objective : objectives_)
    record.taken.push_back(objective->take_view(queue, view));
  return record;
}

void ViewPass::add(Queue& queue, const StepContext& context, const Sample& sample, int in_batch,
                   const ViewRecord& record) {
  const ViewContext view = context_of(context, sample, in_batch);
  GaussianGradients& poses = restore(queue, renderer_, model_, record, tiles_);
  for (size_t i = 0; i < objectives_.size(); ++i)
    objectives_[i]->give_view(queue, view, record.taken[i]);
  add_to_parameters(queue, view, poses, size_t(record.intersections));
}

void ViewPass::end_step(Queue& queue, const StepContext& context) {
  for (const auto& objective : objectives_) objective->end_step(queue, context);
}

void ViewPass::weigh(Queue& queue, const Frame& frame) {
  Shot shot;
  shot.view.camera = pinhole(frames_.camera(frame), near_);
  shot.view.camera_t2 = shot.view.camera;
  shot.time = shot.time_t2 = frame.time;
  shot.sh_degree = 0;
  renderer_.forward(queue, model_, shot);
  v_.zero(queue, renderer_.images(), false, false);
  v_.v_rgb.fill(queue, 1.f);
  renderer_.backward_to_poses(queue, v_);
}

LossReport ViewPass::report(Queue& queue) {
  LossReport report;
  for (const auto& objective : objectives_) objective->report(queue, renderer_, report);
  return report;
}

void ViewPass::rows_changed() {
  for (const auto& objective : objectives_) objective->rows_changed();
}

void ViewPass::save_state(Queue& queue, Arrays& arrays) {
  for (const auto& objective : objectives_) objective->save_state(queue, arrays);
}

void ViewPass::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  for (const auto& objective : objectives_) objective->load_state(queue, arrays, path);
}

}  // namespace gflow
