// SPDX-License-Identifier: Apache-2.0
#include "optim/train/learning_rates.hpp"

#include <algorithm>
#include <cmath>

#include "optim/scene/depths.hpp"
#include "optim/train/curriculum.hpp"
#include "optim/train/sequential.hpp"

namespace gflow {
namespace {

constexpr double kMostPixels = 0.3;  // moved in a step [px]

// Geometric interpolation from a at 0 to b at 1.
float between_rates(float a, float b, double share) {
  return a > 0 ? float(a * std::pow(double(b) / a, share)) : 0.f;
}

// The rates of this training: what the motion model has of its own, and larger steps where there
// are few, so that parameters get as far. Paths of Gaussians are left out: they would bend to
// single frames.
LearningRateOptions rates_of(const TrainOptions& config, const MotionModel& model) {
  constexpr double kMostHaste = 3;
  LearningRateOptions lr = config.lr;
  const float haste = float(std::clamp(lr.steps / double(config.train.iterations), 1., kMostHaste));
  lr.means_final *= haste;
  if (model.has_quick_shapes)
    for (float* rate : {&lr.scales, &lr.quats, &lr.quats_final}) *rate *= haste;
  if (!model.is_permanent) return lr;
  lr.means = config.motion.hexplane.means;
  lr.opacity = config.motion.hexplane.opacity;
  for (float* rate : {&lr.means, &lr.opacity, &lr.sh, &lr.planes, &lr.planes_final, &lr.network,
                      &lr.network_final})
    *rate *= haste;
  return lr;
}

}  // namespace

Rates::Rates(const TrainOptions& config, const Scene& scene, const MotionShape& shape)
    : config_(config),
      lr_(rates_of(config, motion_model_of(shape.motion))),
      scene_(scene),
      shape_(shape) {
  const double pixel = pixel_size(scene) * config.scene.resolution;
  const double moved = scene.extent * double(lr_.means * lr_.motion) / pixel;
  pace_most_ = float(std::clamp(kMostPixels / moved, 1., double(lr_.pace_most)));
}

float Rates::position(int step) const {
  const double share = stage_at(config_.train, std::max(scene_.steps, 1), step).share;
  return float(scene_.extent) * between_rates(lr_.means, lr_.means_final, share);
}

AdamRate Rates::planned(Quantity quantity, int step) const {
  const AdamOptions& eps = config_.adam;
  const double share = stage_at(config_.train, std::max(scene_.steps, 1), step).share;
  const double field_share = Curriculum::of(config_, is_permanent(shape_.motion)).share_after(step);
  const float fade = between_rates(1, lr_.fade, std::max(2 * share - 1, 0.0));
  switch (quantity) {
    case Quantity::position:
      return {position(step), eps.eps_means};
    case Quantity::time:
      return {fade * lr_.mean_t * shape_.duration, eps.eps_means};
    case Quantity::rotation:
      return {between_rates(lr_.quats, lr_.quats_final, share), eps.eps_quats};
    case Quantity::scale:
      return {fade * lr_.scales, eps.eps_scales};
    case Quantity::opacity:
      return {fade * lr_.opacity, eps.eps_opacity};
    case Quantity::color:
      return {fade * lr_.sh, eps.eps_sh};
    case Quantity::plane:
      return {between_rates(lr_.planes, lr_.planes_final, field_share), eps.eps_planes};
    case Quantity::network:
      return {between_rates(lr_.network, lr_.network_final, field_share), eps.eps_network};
    case Quantity::color_rest:
      return {fade * lr_.sh / lr_.sh_rest_divisor, eps.eps_sh};
    case Quantity::weight:
      return {fade * lr_.weights, eps.eps_quats};
  }
  throw Error("this parameter has no learning rate");
}

AdamRate Rates::of(const GroupSpec& spec, int step) const {
  AdamRate rate = planned(spec.quantity, step);
  rate.per_time = spec.per_time;
  if (spec.motion && spec.quantity != Quantity::time) rate.lr *= lr_.motion;
  rate.lr *= scale;
  return rate;
}

}  // namespace gflow
