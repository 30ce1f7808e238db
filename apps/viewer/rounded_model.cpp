// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/rounded_model.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "optim/model/renderer.hpp"

namespace gflow {
namespace {

// Steps, at most: lengths relative to the longest scale of a Gaussian, and angles [rad]. Logs of
// scales, logits of opacities. Colour bands, of which the first counts 0.28 times.
constexpr double kOfItsSize = 1.0 / 32, kAngle = 1.0 / 256, kLog = 1.0 / 32, kLogit = 1.0 / 16,
                 kBand0 = 1.0 / 128, kBands = 1.0 / 64;

// The nearest multiple of the largest power of two within `step`, or x if that is not finite.
float to_multiple(float x, double step) {
  const double power = std::exp2(std::floor(std::log2(step)));
  const double rounded = std::round(double(x) / power) * power;
  return std::isfinite(rounded) ? float(rounded) : x;
}

size_t rows_of(const HostModel& model, const std::string& name) {
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups)
      if (group.name == name) return table.count(model.count);
  return model.count;
}

// Rounds a group that has rows of Gaussians, if the model has it. step(i): of Gaussian i, > 0.
template <class Step>
void round_group(HostModel& model, const std::string& name, Step&& step) {
  const auto found = model.groups.find(name);
  if (found == model.groups.end() || model.count == 0) return;
  std::vector<float>& values = found->second;
  const size_t rows = rows_of(model, name), width = values.size() / rows;
  for (size_t row = 0; row < rows; ++row)
    for (size_t k = 0; k < width; ++k)
      values[row * width + k] = to_multiple(values[row * width + k], step(row % model.count));
}

// Their length means nothing to the model, but steps are for that of 1.
void normalise_quats(HostModel& model, const std::string& name) {
  const auto found = model.groups.find(name);
  if (found == model.groups.end()) return;
  for (size_t i = 0; i + 4 <= found->second.size(); i += 4) {
    Eigen::Map<Eigen::Vector4f> quat(&found->second[i]);
    if (quat.norm() > 0) quat.normalize();
  }
}

}  // namespace

HostModel rounded_model(const HostModel& model) {
  HostModel result = model;
  const auto by = [](double step) { return [step](size_t) { return step; }; };
  const auto size = [&](size_t i) { return std::max(kOfItsSize * longest_scale(model, i), 1e-30); };
  // Longest time from its mean_t at which a Gaussian is seen [model time].
  const auto seen = [&](size_t i) {
    const double life = std::exp(double(model.groups.at("log_scales")[4 * i + 3]));
    return std::clamp(3 * life, 1e-6, double(model.shape.duration));
  };
  for (const char* name : {"quats", "quats_r"}) normalise_quats(result, name);
  for (const char* name : {"means", "key_shifts"}) round_group(result, name, size);
  for (const char* name : {"quats", "quats_r", "key_turns"}) round_group(result, name, by(kAngle));
  for (const char* name : {"log_scales", "key_scales"}) round_group(result, name, by(kLog));
  for (const char* name : {"logit_opacities", "basis_logits"})
    round_group(result, name, by(kLogit));
  round_group(result, "sh0", by(kBand0));
  round_group(result, "sh_rest", by(kBands));
  round_group(result, "means_t", [&](size_t i) { return kOfItsSize * seen(i); });
  round_group(result, "velocities", [&](size_t i) { return size(i) / seen(i); });
  round_group(result, "half_accelerations", [&](size_t i) { return size(i) / seen(i) / seen(i); });
  round_group(result, "turns", [&](size_t i) { return kAngle / seen(i); });
  return result;
}

double psnr_between(Queue& queue, const HostModel& other, const HostModel& model,
                    const std::vector<RenderView>& views, const EngineSettings& settings,
                    double near) {
  Model models[2] = {{queue, other, Purpose::rendering}, {queue, model, Purpose::rendering}};
  Renderer renderer(queue, settings);
  double squares = 0, count = 0;
  for (const RenderView& view : views) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(view.camera, float(near));
    shot.time = view.time;
    std::vector<float> pictures[2];
    for (size_t k = 0; k < 2; ++k) {
      renderer.forward(queue, models[k], shot);
      pictures[k] = renderer.images().rgb.read(queue);
    }
    const auto seen = [](float x) { return std::clamp(double(x), 0.0, 1.0); };
    for (size_t i = 0; i < pictures[0].size(); ++i)
      squares += std::pow(seen(pictures[0][i]) - seen(pictures[1][i]), 2);
    count += double(pictures[0].size());
  }
  return -10 * std::log10(squares / count);
}

}  // namespace gflow
