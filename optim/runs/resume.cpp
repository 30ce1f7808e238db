// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/resume.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "runtime/base/warning.hpp"

namespace gflow {

std::string scene_stamp(const Scene& scene) {
  std::string stamp =
      fmt::format("{} {} {} {}\n", scene.layout, scene.extent, scene.steps, scene.train.size());
  for (const Camera& c : scene.cameras) {
    stamp += fmt::format("{} {} {} {} {} {} {}", c.name, c.width, c.height, c.fx, c.fy, c.cx, c.cy);
    for (const double value : c.viewmat.reshaped()) stamp += fmt::format(" {}", value);
    stamp += "\n";
  }
  for (const Frame& f : scene.train) {
    stamp += fmt::format("{} {} {} {} {} {}\n", f.name, f.camera, f.step, f.time, f.video_frame,
                         std::filesystem::file_size(f.path));
    if (!f.flow_path.empty()) stamp += fmt::format("{}\n", std::filesystem::file_size(f.flow_path));
  }
  return crc32_text(stamp.data(), stamp.size());
}

namespace {

// Error if these settings or this scene would continue another training than the one begun.
void require_same_training(const CheckpointFolder::Found& found, const TrainOptions& config,
                           const std::string& scene, const RunFolder& run) {
  const CheckpointFacts& facts = found.checkpoint.facts;
  TrainOptions former;
  apply_text(former, facts.config, "the settings in " + found.path);
  const auto before = setting_values(former);
  auto now = setting_values(config);
  for (const char* free :
       {"scene.path", "train.minutes", "train.log_every", "train.checkpoint_every",
        "train.save_every", "train.device", "flow.store", "guidance.command", "guidance.timeout",
        "init.strict", "metrics.lpips", "metrics.clip"})
    now.erase(free);
  for (const auto& [name, value] : now)
    if (value != before.at(name))
      throw Error(fmt::format(
          "resuming {}: it was started with {} = {}, not {}, which affects the steps already "
          "trained; keep the setting, or start over with --overwrite instead of --resume",
          run.folder(), name, before.at(name), value));
  if (scene != facts.scene)
    throw Error(
        fmt::format("resuming {}: cameras or images of {} have changed since it was started; "
                    "restore the scene, or start over with --overwrite instead of --resume",
                    run.folder(), config.scene.path));
}

// On another device or build the result is correct, but not bitwise equal.
void warn_of_other_bits(const CheckpointFacts& facts, const DeviceInfo& device) {
  const auto other = [](const char* what, const std::string& before, const std::string& now) {
    if (before != now)
      warn(
          fmt::format("the checkpoint was written {} {}, this is {}: the result will not be "
                      "bit-identical to an uninterrupted training",
                      what, before, now));
  };
  other("on", facts.device, device_stamp(device));
  other("by gflow build", facts.program, program_stamp());
}

}  // namespace

void require_resumable(const CheckpointFolder::Found& found, const Queue& queue,
                       const TrainOptions& config, const Scene& scene, const RunFolder& run) {
  require_same_training(found, config, scene_stamp(scene), run);
  warn_of_other_bits(found.checkpoint.facts, queue.info);
}

std::string resuming_command(const RunFolder& run, const TrainOptions& config) {
  const bool starts_program = config.guidance.provider == GuidanceProvider::process;
  return fmt::format("gflow train -o {} --resume{}", run.folder(),
                     starts_program ? " --allow-command" : "");
}

std::string how_to_resume(const RunFolder& run, const TrainOptions& config) {
  return fmt::format("`{}` continues from there", resuming_command(run, config));
}

Checkpointer::Checkpointer(Queue& queue, const TrainOptions& config, const Scene& scene,
                           const RunFolder& run, Trainer& trainer, const ModelShape& shape)
    : queue_(queue), folder_(run.checkpoints()), trainer_(trainer) {
  facts_.config = to_toml(config);
  facts_.scene = scene_stamp(scene);
  facts_.device = device_stamp(queue.info);
  facts_.program = program_stamp();
  facts_.shape = shape;
}

void Checkpointer::write(int step, double seconds) {
  facts_.step = step;
  facts_.seconds = seconds;
  folder_.write({facts_, trainer_.state(queue_)});
}

void Checkpointer::write_to(const std::string& path, int step) {
  facts_.step = step;
  write_checkpoint(path, {facts_, trainer_.state(queue_)});
}

void Checkpointer::try_write(int step, double seconds) {
  try {
    write(step, seconds);
  } catch (const Error& problem) {
    warn(fmt::format("checkpoint of step {} not saved: {}; training continues", step,
                     problem.what()));
  }
}

}  // namespace gflow
