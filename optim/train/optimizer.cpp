// SPDX-License-Identifier: Apache-2.0
#include "optim/train/optimizer.hpp"

#include <algorithm>

namespace gflow {
namespace {

constexpr int kStepsToRateScales = 100;  // steps between two updates of the rate_scale

std::unique_ptr<Adam> path_adam_for(Queue& queue, const AdamOptions& adam,
                                    const Parameters& parameters) {
  const AdamConfig config{adam.beta1_paths, adam.beta2, false};
  return parameters.more.empty() ? nullptr : std::make_unique<Adam>(queue, config);
}

}  // namespace

Optimizer::Optimizer(Queue& queue, const TrainOptions& options, const Scene& scene, Model& model)
    : options_(options),
      scene_(scene),
      model_(model),
      rates_(options, scene, model.shape),
      adam_(queue, {options.adam.beta1, options.adam.beta2}),
      path_adam_(path_adam_for(queue, options.adam, model.parameters)),
      population_(queue, options, scene, model) {}

void Optimizer::begin_step(Queue& queue, const Stage& stage) {
  if (options_.skip.unseen)
    model_.parameters.forget_seen(queue);
  else
    model_.parameters.count_as_seen(queue);
  if (stage.begins && stage.time_step > 0)
    model_.motion->start_key(queue, model_.parameters, stage.time_step);
}

bool Optimizer::step(Queue& queue, const Renderer& renderer, const Stage& stage, int step,
                     bool warming, int sh_degree) {
  update(queue, stage, step, warming, sh_degree);
  return population_.after_step(queue, renderer, stage, step, rates_.position(step));
}

void Optimizer::update(Queue& queue, const Stage& stage, int step, bool warming, int sh_degree) {
  const LearningRateOptions& lr = options_.lr;
  Parameters& p = model_.parameters;
  if (step % kStepsToRateScales == 0) {  // Gaussians are added, and their lifetimes change
    const float time_step = model_.shape.duration / float(std::max(scene_.steps, 1));
    model_.motion->set_rate_scales(queue, p,
                                   {model_.shape.duration, time_step, lr.pace, rates_.pace_most()});
  }
  model_.motion->regularize(queue, p, options_.motion);
  if (stage.time_step > 0) {  // train one key only; flow leads to the one before
    Table& keys = p.more[0];
    keys.rows.seen.fill_range(queue, 0, size_t(stage.time_step) * p.moving, 0u);
  }
  population_.add_gradients(queue);
  const auto unused = [&](const GroupSpec& spec) {
    return options_.skip.bands && spec.quantity == Quantity::color_rest && sh_degree == 0;
  };
  for (Table* table : p.tables()) {
    const bool moving = table != &p;
    if (moving ? !stage.moves() || warming : !stage.fits()) continue;
    Adam& adam = moving ? *path_adam_ : adam_;
    for (size_t g = 0; g < table->groups.size(); ++g)
      if (!unused(table->specs[g]))
        adam.refuse(queue, table->groups[g], table->rows, table->active_in(table->specs[g]));
    adam.advance(queue, table->rows, table->active);
    for (size_t g = 0; g < table->groups.size(); ++g) {
      const GroupSpec& spec = table->specs[g];
      if (unused(spec)) continue;
      // A scene with one time step, or the first stage of train.sequential, has no motion.
      if (spec.motion && (scene_.steps < 2 || stage.time_step == 0)) continue;
      adam.step(queue, table->groups[g], table->rows, table->active_in(spec),
                rates_.of(spec, step));
    }
  }
}

}  // namespace gflow
