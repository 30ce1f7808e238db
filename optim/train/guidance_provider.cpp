// SPDX-License-Identifier: Apache-2.0
#include "optim/train/guidance_provider.hpp"

#include <fmt/format.h>

#include "optim/guidance/onnx.hpp"
#include "optim/guidance/process.hpp"
#include "optim/guidance/sds_guidance.hpp"

namespace gflow {
namespace {

NoiseSchedule schedule_of(const GuidanceOptions& config) {
  const double first = double(config.beta_start), last = double(config.beta_end);
  return config.schedule == NoiseKind::linear
             ? NoiseSchedule::linear(config.timesteps, first, last)
             : NoiseSchedule::scaled_linear(config.timesteps, first, last);
}

void require_set(const std::string& value, const GuidanceOptions& config, const char* setting,
                 const char* what) {
  if (value.empty())
    throw Error(fmt::format("guidance.provider is \"{}\", but {} is empty: it must name {}",
                            name_of(config.provider), setting, what));
}

}  // namespace

std::unique_ptr<Guidance> guidance_of(const TrainOptions& train) {
  const GuidanceOptions& config = train.guidance;
  const SdsRule rule{double(config.t_min), double(config.t_max), double(config.t_max_final),
                     double(config.scale)};
  switch (config.provider) {
    case GuidanceProvider::none:
      return nullptr;
    case GuidanceProvider::process:
      require_set(config.command, config, "guidance.command", "the program to start");
      return std::make_unique<ProcessGuidance>(config.command, double(config.timeout), rule);
    case GuidanceProvider::onnx:
      require_set(config.model, config, "guidance.model", "the network's file");
      return std::make_unique<SdsGuidance>(std::make_unique<OnnxDenoiser>(config.model),
                                           schedule_of(config), rule);
    case GuidanceProvider::analytic:
      return std::make_unique<AnalyticGuidance>(
          config.images.empty() ? train.scene.path : config.images, double(config.variance),
          schedule_of(config), rule);
  }
  throw Error("unknown guidance provider");
}

void require_no_program(const TrainOptions& config, const std::string& where) {
  if (config.guidance.provider != GuidanceProvider::process || config.guidance.command.empty())
    return;
  const std::string& command = config.guidance.command;
  throw Error(
      fmt::format("{} starts a program, guidance.command = {}: add --allow-command to permit it",
                  where, command.substr(0, command.find('\n'))));
}

void require_guided_views(const TrainOptions& train, const Scene& scene) {
  const GuidanceOptions& config = train.guidance;
  if (!config.enabled() || config.cameras == GuidanceCameras::orbit) return;
  const bool test = config.cameras == GuidanceCameras::test;
  if ((test ? scene.test : scene.val).empty())
    throw Error(
        fmt::format("guidance.cameras is \"{}\", but scene '{}' has no {} views: choose orbit",
                    name_of(config.cameras), scene.name, name_of(config.cameras)));
}

}  // namespace gflow
