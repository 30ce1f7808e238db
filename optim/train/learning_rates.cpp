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

}  // namespace

Rates::Rates(const TrainOptions& config, const Scene& scene, const MotionShape& shape)
    : config_(config), scene_(scene), shape_(shape) {
  const double pixel = pixel_size(scene) * config.scene.resolution;
  const double moved = scene.extent * double(config.lr.means * config.lr.motion) / pixel;
  pace_most_ = float(std::clamp(kMostPixels / moved, 1., double(config.lr.pace_most)));
}

float Rates::position(int step) const {
  const double share = stage_at(config_.train, std::max(scene_.steps, 1), step).share;
  const LearningRateOptions& lr = config_.lr;
  const float first = is_permanent(shape_.motion) ? config_.motion.hexplane.means : lr.means;
  const float ratio = lr.means > 0 ? lr.means_final / lr.means : 1;
  return float(scene_.extent) * between_rates(first, first * ratio, share);
}

AdamRate Rates::planned(Quantity quantity, int step) const {
  const LearningRateOptions& lr = config_.lr;
  const AdamOptions& eps = config_.adam;
  const bool permanent = is_permanent(shape_.motion);
  const double share = stage_at(config_.train, std::max(scene_.steps, 1), step).share;
  const double field_share = Curriculum::of(config_, permanent).share_after(step);
  const float fade = between_rates(1, lr.fade, std::max(2 * share - 1, 0.0));
  switch (quantity) {
    case Quantity::position:
      return {position(step), eps.eps_means};
    case Quantity::time:
      return {fade * lr.mean_t * shape_.duration, eps.eps_means};
    case Quantity::rotation:
      return {between_rates(lr.quats, lr.quats_final, share), eps.eps_quats};
    case Quantity::scale:
      return {fade * lr.scales, eps.eps_scales};
    case Quantity::opacity:
      return {fade * (permanent ? config_.motion.hexplane.opacity : lr.opacity), eps.eps_opacity};
    case Quantity::color:
      return {fade * lr.sh, eps.eps_sh};
    case Quantity::plane:
      return {between_rates(lr.planes, lr.planes_final, field_share), eps.eps_planes};
    case Quantity::network:
      return {between_rates(lr.network, lr.network_final, field_share), eps.eps_network};
    case Quantity::color_rest:
      return {fade * lr.sh / lr.sh_rest_divisor, eps.eps_sh};
    case Quantity::weight:
      return {fade * lr.weights, eps.eps_quats};
  }
  throw Error("this parameter has no learning rate");
}

AdamRate Rates::of(const GroupSpec& spec, int step) const {
  AdamRate rate = planned(spec.quantity, step);
  rate.per_time = spec.per_time;
  if (spec.motion && spec.quantity != Quantity::time) rate.lr *= config_.lr.motion;
  rate.lr *= scale;
  return rate;
}

}  // namespace gflow
