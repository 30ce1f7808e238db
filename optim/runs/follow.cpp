// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/follow.hpp"

#include <fmt/format.h>

#include "optim/guidance/guidance_options.hpp"
#include "optim/init/init.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/seat.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {
namespace {

// What all devices must have in common, each with its name in messages.
struct Common {
  std::string what, mine;
};

std::vector<Common> common_of(const Queue& queue, const Scene& scene) {
  return {{"gflow", program_stamp()},
          {"the scene", scene_stamp(scene)},
          {"the device", device_stamp(queue.info)}};
}

void require_common(Seat& seat, const Queue& queue, const Scene& scene) {
  const auto names = seat.exchange(seat.name());
  for (const Common& common : common_of(queue, scene)) {
    const auto all = seat.exchange(common.mine);
    for (size_t i = 1; i < all->size(); ++i)
      if ((*all)[i] != all->front())
        throw Error(fmt::format(
            "training on several devices: {} of {} is {}, that of {} is {}; it must be the same",
            common.what, (*names)[i], (*all)[i], names->front(), all->front()));
  }
}

// The model shape that the leader has.
ModelShape shape_like(const CheckpointFacts& facts, const Scene& scene,
                      const TrainOptions& config) {
  ModelShape shape = model_shape(scene, config);
  if (!motion_model_of(shape.motion).kept_numbers.empty()) enclose_as(shape, *facts.shape);
  return shape;
}

void train_along(Seat& seat, Queue& queue) {
  const ScratchFolder folder("follow");
  const std::string path = folder.file("start.npz");
  const std::string start = seat.from_leader();
  write_file_atomically(path, Bytes(start.begin(), start.end()));
  const Checkpoint checkpoint = read_checkpoint(path);
  TrainOptions config;
  apply_text(config, checkpoint.facts.config, "the leader's settings");
  Preparation prepared(config, folder.file("frames"));
  require_common(seat, queue, prepared.scene());
  prepared.compute_flow(folder.file("flow"), true);
  prepared.find_motion_masks();
  Model model(queue, shape_like(checkpoint.facts, prepared.scene(), config), 0);
  Trainer trainer = prepared.trainer(queue, model);
  trainer.set_state(queue, checkpoint.arrays, path);
  trainer.join(seat);
  seat.exchange("");  // ready
  trainer.follow(queue);
  prepared.flows().prefetch({});
}

}  // namespace

void require_divisible(const TrainOptions& config, size_t devices) {
  if (devices < 2) return;
  const auto refuse = [&](const std::string& why) {
    throw Error(fmt::format("training on {} devices: {}", devices, why));
  };
  if (config.train.batch < int(devices))
    refuse(fmt::format(
        "each renders its views of a batch, but train.batch is {}; give --set train.batch={} or "
        "more, or fewer devices",
        config.train.batch, devices));
  if (config.guidance.provider != GuidanceProvider::none)
    refuse("guidance of novel views needs one device; set guidance.provider=none or use one");
}

void lead(Seat& seat, Queue& queue, const Scene& scene, Checkpointer& checkpoints, int step,
          Trainer& trainer) {
  const ScratchFolder folder("lead");
  const std::string path = folder.file("start.npz");
  checkpoints.write_to(path, step);
  const Bytes start = read_file(path);
  seat.exchange(std::string(start.begin(), start.end()));
  require_common(seat, queue, scene);
  trainer.join(seat);
  seat.exchange("");  // all are ready
}

void follow(Seat& seat, Queue& queue) noexcept {
  try {
    train_along(seat, queue);
  } catch (const TrainingEnded&) {
  } catch (const std::exception& problem) {
    seat.fail(problem.what());
  }
}

}  // namespace gflow
