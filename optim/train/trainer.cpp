// SPDX-License-Identifier: Apache-2.0
#include "optim/train/trainer.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/engine/random_streams.hpp"
#include "optim/motion/parameters_state.hpp"
#include "optim/train/orders.hpp"
#include "shared/random.h"

namespace gflow {

Trainer::Trainer(const TrainInputs& in, std::vector<Rect> parts,
                 const std::vector<MakeObjective>& more)
    : in_(in),
      sampler_(in.options, in.scene, in.frames, in.pairs, in.flows, std::move(parts),
               in.model.shape),
      view_pass_(in.queue, engine_settings(in.options),
                 near_or_default(in.options.render.near, in.scene), in.scene.steps, in.frames,
                 in.model, make_objectives(in, more)),
      optimizer_(in.queue, in.options, in.scene, in.model),
      reduce_(in.queue) {}

Trainer::~Trainer() {
  try {
    in_.queue.finish();
  } catch (const Error&) {  // the device failed, which has been reported
  }
}

int Trainer::sh_degree(int step) const {
  return std::min(in_.options.motion.sh_degree, step / in_.options.motion.sh_interval);
}

std::array<uint8_t, 3> Trainer::background(int step) const {
  const TrainOptions& options = in_.options;
  if (options.scene.background != Background::random || !in_.scene.has_alpha) {
    const uint8_t level = shown_level(options.scene.background);
    return {level, level, level};
  }
  const uint bits = random_bits(uint(options.train.seed), streams::kBackground, uint(step));
  return {uint8_t(bits >> 8), uint8_t(bits >> 16), uint8_t(bits >> 24)};
}

void Trainer::prefetch(int step) {
  std::vector<const Frame*> frames;
  std::vector<size_t> flows;
  for (int next = step + 1; next < in_.options.train.iterations; ++next) {
    const std::vector<Sample> samples = sampler_.at(next);
    for (size_t b = 0; b < samples.size(); ++b) {
      if (seat_ && seat_->owner(b, samples.size()) != seat_->index()) continue;
      const Sample& sample = samples[b];
      if (next == step + 1) frames.push_back(sample.frame);
      if (sample.pair >= 0) flows.push_back(size_t(sample.pair));
    }
    const bool enough =
        in_.flows.is_precomputed() || next - step >= int(in_.flows.prefetch_count());
    if (enough) break;
  }
  in_.frames.prefetch(frames);
  in_.flows.prefetch(flows);
}

void Trainer::see(Queue& queue, const Sample& sample) {
  const Camera& camera = in_.frames.camera(*sample.frame);
  const bool some_ignored = in_.scene.masks == Masks::ignore && !sample.frame->mask_path.empty();
  optimizer_.population().see(queue, renderer(), renderer().shot(), camera.width, camera.height,
                              some_ignored);
}

void Trainer::run_views(Queue& queue, const StepContext& context,
                        const std::vector<Sample>& samples) {
  const bool all_posed = optimizer_.population().needs_all_posed();
  for (size_t b = 0; b < samples.size(); ++b) {
    view_pass_.run(queue, context, samples[b], int(b), all_posed);
    untouched_ = false;
    see(queue, samples[b]);
  }
}

void Trainer::run_divided_views(Queue& queue, const StepContext& context,
                                const std::vector<Sample>& samples) {
  const bool all_posed = optimizer_.population().needs_all_posed();
  std::string mine;
  for (size_t b = 0; b < samples.size(); ++b)
    if (seat_->owner(b, samples.size()) == seat_->index())
      append(mine, view_pass_.render(queue, context, samples[b], int(b), all_posed));
  const auto records = seat_->exchange(mine);
  std::vector<const char*> at;  // the next record of each device
  for (const std::string& bytes : *records) at.push_back(bytes.data());
  untouched_ = false;
  for (size_t b = 0; b < samples.size(); ++b) {
    const ViewRecord record = take(at[seat_->owner(b, samples.size())]);
    view_pass_.add(queue, context, samples[b], int(b), record);
    see(queue, samples[b]);
  }
}

void Trainer::step(Queue& queue, int step) {
  if (seat_) seat_->exchange(order_to_step(step, rate_scale()));
  make_step(queue, step);
}

void Trainer::follow(Queue& queue) {
  try {
    for (;;) {
      const std::string order = seat_->from_leader();
      if (is_state(order)) {
        apply_state(queue, arrays_of_order(order), "the leader's state");
        continue;
      }
      const StepOrder step = step_of_order(order);
      set_rate_scale(step.rate_scale);
      make_step(queue, step.number);
    }
  } catch (const TrainingEnded&) {
  }
}

void Trainer::make_step(Queue& queue, int step) {
  untouched_ = true;
  prefetch(step);
  Population& population = optimizer_.population();
  if (step == 0 && population.put_in_order(queue)) view_pass_.rows_changed();
  const auto weigh = [&](const Frame& frame) { view_pass_.weigh(queue, frame); };
  if (population.fade_hidden(queue, step, renderer(), weigh)) untouched_ = false;
  const Stage now = stage(step);
  const std::vector<Sample> samples = sampler_.at(step);
  const StepContext context{step, samples.front().frame, background(step), sh_degree(step)};
  view_pass_.begin_step(queue, context);
  optimizer_.begin_step(queue, now);
  // First, because the guidance provider may fail.
  view_pass_.run_novel_views(queue, context, [&](const Shot& shot) {
    untouched_ = false;
    const PinholeCamera& camera = shot.view.camera;
    population.see(queue, renderer(), shot, camera.width, camera.height, false);
  });
  seat_ ? run_divided_views(queue, context, samples) : run_views(queue, context, samples);
  untouched_ = false;
  view_pass_.end_step(queue, context);
  const bool warming = sampler_.curriculum().warming(step);
  if (optimizer_.step(queue, renderer(), now, step, warming, context.sh_degree))
    view_pass_.rows_changed();
}

Arrays Trainer::state(Queue& queue) {
  Arrays arrays;
  save_state(queue, in_.model.parameters, arrays);
  optimizer_.population().save_state(queue, arrays);
  if (rate_scale() != 1) arrays["caution"] = {{1}, std::vector<float>{rate_scale()}};
  view_pass_.save_state(queue, arrays);
  return arrays;
}

void Trainer::set_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  apply_state(queue, arrays, path);
  if (seat_) seat_->exchange(order_of_state(arrays));
}

void Trainer::apply_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  load_state(queue, in_.model.parameters, arrays, path);
  optimizer_.population().load_state(queue, arrays, path);
  const bool is_scaled = arrays.count("caution");
  set_rate_scale(is_scaled ? exact_values<float>(arrays, "caution", {1}, path)[0] : 1);
  view_pass_.load_state(queue, arrays, path);
}

StepReport Trainer::counts(Queue& queue) {
  constexpr cl_uint ten_steps = 10;
  StepReport counts;
  const Parameters& p = in_.model.parameters;
  counts.gaussians = p.count;
  counts.moving = p.moving;
  counts.rejected = reduce_.count_nonzero(queue, p.rows.rejected);
  for (size_t t = 0; t < p.more.size(); ++t) {
    const Buffer<cl_uint>& rejected = p.more[t].rows.rejected;
    counts.rejected += reduce_.count_nonzero(queue, rejected);
    if (p.more_specs[t].rows > 0) counts.stuck += reduce_.count_above(queue, rejected, ten_steps);
  }
  return counts;
}

StepReport Trainer::report(Queue& queue) {
  StepReport report = counts(queue);
  static_cast<LossReport&>(report) = view_pass_.report(queue);
  return report;
}

std::string Trainer::take_notice() {
  const int many = std::min(100, in_.options.train.iterations);
  if (view_pass_.empty_views() < many || warned_of_emptiness_)
    return optimizer_.population().take_notice();
  warned_of_emptiness_ = true;
  return fmt::format(
      "no Gaussian was visible in {} images in a row: check that camera poses and initial points "
      "share one coordinate system",
      many);
}

}  // namespace gflow
