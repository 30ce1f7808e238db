// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/follow_paths.hpp"

#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kLearntFrom = 1500;  // paths, at most
constexpr float kUnseen = 0.1f;       // weight of a place that was not seen
constexpr float kFitWeight = 100;     // of the mean squared distance [extents], against rigidity
constexpr float kPlaneRate = 0.036f, kNetworkRate = 0.0072f;  // at the first step

// Parameters of every stride-th of the first `count` Gaussians, with what all share.
Parameters parameters_of(Queue& queue, const Motion& motion, const HostModel& model, size_t count,
                         size_t stride) {
  Parameters p(queue, (count + stride - 1) / stride, motion.groups(), motion.tables());
  for (ParameterGroup& group : p.groups) {
    const std::vector<float>& all = model.groups.at(group.values.name());
    std::vector<float> some;
    for (size_t i = 0; i < count; i += stride)
      some.insert(some.end(), &all[group.width * i], &all[group.width * i] + group.width);
    group.values.write(queue, some);
  }
  for (Table& table : p.more)
    for (ParameterGroup& group : table.groups)
      group.values.write(queue, model.groups.at(group.values.name()));
  return p;
}

// Trains what Gaussians share, and not the Gaussians, on the places of paths at single frames.
void train_field(Queue& queue, HostModel& model, const Paths& paths, const Scene& scene,
                 const TrainOptions& options, const ProgressCallback& progress) {
  const auto motion = make_motion(queue, model.shape);
  const size_t stride = (paths.count() + kLearntFrom - 1) / kLearntFrom;
  Parameters p = parameters_of(queue, *motion, model, paths.count(), stride);
  const size_t n = p.count;
  Adam adam(queue, {options.adam.beta1_paths, options.adam.beta2, false});
  const Buffer<cl_uint> all(queue, std::vector<cl_uint>(n, 1u), "all");
  const Buffer<float> v_factors(queue, std::vector<float>(9 * n, 0.f), "v_factors");
  const Buffer<float> v_opacities(queue, std::vector<float>(n, 0.f), "v_opacities");
  Buffer<float> v_means(queue, 3 * n, "v_means");
  GaussiansAt at;
  std::vector<float> v(3 * n);
  const float weight = 2 * kFitWeight / float(double(n) * scene.extent * scene.extent);
  for (size_t step = 0; step < kStepsOnPaths; ++step) {
    const uint any = random_bits(uint(options.train.seed), streams::kPathFrames, uint(step));
    const size_t frame = any % paths.frames();
    const float t = float(paths.times[frame]) * model.shape.duration;
    p.forget_seen(queue);
    motion->at(queue, p, t, nullptr, at);
    const std::vector<float> means = at.means.read(queue);
    for (size_t k = 0; k < n; ++k) {
      const float* to = paths.at(k * stride, frame);
      const float w = weight * (paths.is_seen(k * stride, frame) ? 1 : kUnseen);
      for (size_t c = 0; c < 3; ++c) v[3 * k + c] = w * (means[3 * k + c] - to[c]);
    }
    v_means.write(queue, v);
    motion->backward(queue, p, t, true, all, v_means, v_factors, v_opacities);
    const float fade = float(0.5 + 0.5 * std::cos(M_PI * double(step) / kStepsOnPaths));
    for (Table& table : p.more) {
      for (ParameterGroup& group : table.groups)
        adam.refuse(queue, group, table.rows, table.active);
      adam.advance(queue, table.rows, table.active);
      for (size_t g = 0; g < table.groups.size(); ++g) {
        const bool planes = table.specs[g].quantity == Quantity::plane;
        if (!planes && table.specs[g].quantity != Quantity::network) continue;
        const AdamRate rate{fade * (planes ? kPlaneRate : kNetworkRate), options.adam.eps_network};
        adam.step(queue, table.groups[g], table.rows, table.active, rate);
      }
    }
    if (progress) progress(step + 1, kStepsOnPaths);
  }
  for (const Table& table : p.more)
    for (const ParameterGroup& group : table.groups)
      model.groups[group.values.name()] = group.values.read(queue);
}

// The velocity of a path where it was chosen [scene units per model time].
std::array<double, 3> velocity_of(const Paths& paths, size_t i, float duration) {
  const size_t frame = size_t(paths.first_seen[i]);
  const size_t before = frame - std::min<size_t>(frame, 1);
  const size_t after = std::min(frame + 1, paths.frames() - 1);
  const double apart = (paths.times[after] - paths.times[before]) * double(duration);
  std::array<double, 3> velocity{};
  for (size_t c = 0; c < 3; ++c)
    velocity[c] = double(paths.at(i, after)[c] - paths.at(i, before)[c]) / apart;
  return velocity;
}

}  // namespace

void follow_paths(Queue& queue, HostModel& model, const Paths& paths, const Scene& scene,
                  const TrainOptions& options, const ProgressCallback& progress) {
  if (is_permanent(model.shape.motion))
    return train_field(queue, model, paths, scene, options, progress);
  const float duration = model.shape.duration;
  for (size_t i = 0; i < paths.count(); ++i)
    set_velocity(model.shape, model.groups, i, velocity_of(paths, i, duration),
                 double(paths.size[i]), double(duration * kPathLifetime));
}

}  // namespace gflow
