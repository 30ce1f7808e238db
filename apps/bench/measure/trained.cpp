// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/trained.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "apps/bench/measure/steps.hpp"
#include "apps/common/command_line.hpp"
#include "optim/eval/evaluation.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"

namespace gflow::bench {
namespace {

// Trainings timed in turn; each keeps its images in memory.
constexpr size_t kSideBySide = 6;

void choose(TrainOptions& config, const EngineSettings& settings) {
  config.flow.transport = settings.transport;
  config.flow.stop = settings.stop;
  config.flow.top_k = settings.top_k;
  config.skip = settings.skip;
  config.defines = settings.defines;
}

Evaluation trained(Queue& queue, const Choice& choice, const TrainingOptions& o, int steps,
                   int seed, const ScratchFolder& folder) {
  TrainOptions config;
  config.scene.path = o.scene;
  for (const std::string& setting : o.settings) apply_setting(config, setting);
  choose(config, choice.settings);
  config.train.iterations = steps;
  config.train.seed = seed;
  check(config);
  Preparation prepared(config, folder.file("frames"));
  prepared.compute_flow(folder.file("flow"), true);
  prepared.find_motion_masks();
  Model model(queue, prepared.first_model(queue));
  Trainer trainer = prepared.trainer(queue, model);
  for (int step = 0; step < steps; ++step) {
    trainer.step(queue, step);
    stop_if_interrupted();
  }
  return evaluate(queue, model, config, prepared.loaded(), prepared.scene().test, {}, "",
                  folder.file("flow"));
}

}  // namespace

void require_trainable(const TrainingOptions& o) {
  TrainOptions asked;
  asked.scene.path = o.scene;
  for (const std::string& setting : o.settings) apply_setting(asked, setting);
  check(asked);
  TrainOptions chosen = asked;
  choose(chosen, {});
  const auto wanted = setting_values(asked), used = setting_values(chosen);
  for (const auto& [name, value] : wanted)
    if (used.at(name) != value)
      throw Error(
          fmt::format("--set {}={}: that is what the choices of this table differ by; "
                      "--knob says which of them are tried",
                      name, value));
  read_scene(o.scene, asked.scene);
}

std::vector<TrainedChoice> train_choices(Queue& queue, const std::vector<Choice>& choices,
                                         const TrainingOptions& o, int repeats,
                                         const GlobalOptions& options) {
  const InterruptGuard guard;
  const ScratchFolder folder("bench");
  std::vector<std::unique_ptr<Queue>> queues;  // for other numbers of lanes
  std::vector<Kind> kinds;
  for (const Choice& choice : choices) {
    Kind kind{choice.name, {}};
    kind.change = [&choice](TrainOptions& config) { choose(config, choice.settings); };
    if (choice.lanes) {
      QueueOptions queue_options;
      queue_options.lanes = choice.lanes;
      queues.push_back(std::make_unique<Queue>(open_queue(options, queue_options)));
      kind.queue = queues.back().get();
    }
    kinds.push_back(kind);
  }

  StepOptions timing;
  timing.scene = o.scene;
  timing.settings = o.settings;
  timing.warm = std::max(1, o.steps / 2);
  timing.common.repeats = repeats;
  const Trained from = warmed_up(queue, timing, folder, options.quiet);
  timing = with_whole_blocks(timing, from, options.quiet);
  std::vector<TrainedChoice> all{{choices[0], {1, 1, 1}, o.steps, {}, {}, {}}};
  for (size_t first = 1; first < kinds.size(); first += kSideBySide) {
    const size_t end = std::min(first + kSideBySide, kinds.size());
    if (!options.quiet)
      print_status("steps of {} to {} of {} choices\n", first + 1, end, kinds.size());
    std::vector<Kind> group{kinds[0]};
    group.insert(group.end(), kinds.begin() + long(first), kinds.begin() + long(end));
    const std::vector<StepCost> costs = costs_of_steps(queue, timing, group, from, folder);
    for (size_t i = 1; i < group.size(); ++i) {
      const Spread ratio = ratio_of(costs[i].cpu, costs[0].cpu);
      const int steps = std::max(1, int(o.steps / ratio.median));
      all.push_back({choices[first + i - 1], ratio, steps, {}, {}, {}});
    }
  }

  for (size_t i = 0; i < all.size(); ++i)
    for (int seed = 0; seed < o.seeds; ++seed) {
      TrainedChoice& one = all[i];
      if (!options.quiet)
        print_status("training {} of {}: {}, {} steps, seed {}\n", i * o.seeds + seed + 1,
                     all.size() * o.seeds, one.choice.name, one.steps, seed);
      const ViewMetrics mean =
          trained(kinds[i].queue ? *kinds[i].queue : queue, one.choice, o, one.steps, seed, folder)
              .mean;
      one.psnr.push_back(mean.psnr);
      one.psnr_dynamic.push_back(mean.psnr_dynamic);
      one.flow_epe_dynamic.push_back(mean.flow_epe_dynamic);
    }
  return all;
}

}  // namespace gflow::bench
