// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/steps.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <memory>
#include <numeric>

#include "apps/common/command_line.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/primitives/reduce.hpp"

namespace gflow::bench {
namespace {

TrainOptions configured(const StepOptions& o, const Kind& kind) {
  TrainOptions config;
  config.scene.path = o.scene;
  for (const std::string& setting : o.settings) apply_setting(config, setting);
  for (const std::string& setting : kind.settings) apply_setting(config, setting);
  if (kind.change) kind.change(config);
  // Gaussians are added in the first half only.
  const int most = o.block + std::max(2, config.flow.every);  // see with_whole_blocks()
  config.train.iterations = 2 * std::max(o.warm, most * (o.common.repeats + 2));
  check(config);
  return config;
}

// Parameters per Gaussian that Adam updates; without higher SH bands if they are unused.
double parameters_of_one(const HostModel& model, bool without_bands) {
  size_t values = 0;
  for (const auto& [name, group] : model.groups)
    if (!without_bands || name != "sh_rest") values += group.size();
  return double(values) / double(std::max<size_t>(model.count, 1));
}

// The model with the parts of its shape that settings may change.
HostModel shown_by(const TrainOptions& config, HostModel model) {
  model.shape.cutoff = config.motion.cutoff;
  return model;
}

// Continues a training with the settings of one kind.
class GoingOn {
 public:
  GoingOn(Queue& queue, const StepOptions& o, const Kind& kind, const Trained& from,
          const ScratchFolder& folder)
      : queue_(kind.queue ? *kind.queue : queue),
        config_(configured(o, kind)),
        prepared_(config_, folder.file("frames")),
        model_(queue_, shown_by(config_, from.model)),
        step_(o.warm) {
    prepared_.compute_flow(folder.file("flow"), true);
    prepared_.find_motion_masks();
    trainer_.reset(new Trainer(prepared_.trainer(queue_, model_)));
    trainer_->set_state(queue_, from.state, "the first training");
  }

  void block(int steps) {
    queue_.finish();
    queue_.reset_timings();
    const auto start = std::chrono::steady_clock::now();
    const double cpu = cpu_seconds(), host = thread_cpu_seconds();
    for (const int end = step_ + steps; step_ < end; ++step_) trainer_->step(queue_, step_);
    cost.host.push_back(1e3 * (thread_cpu_seconds() - host) / steps);
    queue_.finish();
    cost.cpu.push_back(1e3 * (cpu_seconds() - cpu) / steps);
    const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
    cost.wall.push_back(wall.count() / steps);
    append_kernels(cost.kernels, queue_, cost.wall.size() - 1, steps);
  }

  // Runs `steps` more steps and averages the work they do.
  StepCost end(int steps) {
    cost.busy = sum_of(cost.kernels);
    cost.end = model_.read(queue_);
    cost.work = {};
    for (int k = 0; k < steps; ++k) {
      trainer_->step(queue_, step_++);
      count(1.0 / steps);
    }
    return std::move(cost);
  }

  StepCost cost;

 private:
  // Adds the work of the last step with this weight.
  void count(double share) {
    const Renderer& renderer = trainer_->renderer();
    const Engine& engine = renderer.engine();
    const Shot& shot = renderer.shot();
    Reduce reduce(queue_);
    const Pairs pairs = count_pairs(queue_, engine, engine_settings(config_),
                                    &trainer_->image_gradients(), shot.flow);
    cost.work.pairs.listed += share * pairs.listed;
    cost.work.pairs.masked += share * pairs.masked;
    cost.work.pairs.blended += share * pairs.blended;
    cost.work.pairs.back += share * pairs.back;
    cost.work.listed += share * double(renderer.rows().count());
    const std::vector<float> opacities = renderer.gaussians().opacities.read(queue_);
    cost.work.posed += share * double(std::count_if(opacities.begin(), opacities.end(),
                                                    [](float opacity) { return opacity > 0; }));
    if (shot.flow || shot.pose_t2) {
      const std::vector<cl_uint> twice = renderer.with_second_time().read(queue_);
      const size_t moving = std::min(renderer.rows().count(), shot.view.moving);
      cost.work.posed_t2 +=
          share *
          double(moving - size_t(std::count(twice.begin(), twice.begin() + long(moving), 0u)));
    }
    if (shot.flow) {
      const Buffer<cl_uchar>* chosen = engine.tiles_with_flow();
      size_t tiles = engine.tiles().count();
      if (chosen) {
        const std::vector<cl_uchar> with_flow = chosen->read(queue_);
        tiles = size_t(std::count(with_flow.begin(), with_flow.begin() + long(tiles), 1));
      }
      cost.work.tiles_with_flow += share * double(tiles);
      cost.work.tiles_back += share * double(engine.flow_in_parts(trainer_->image_gradients())
                                                 ? tiles_asking_flow(queue_, engine.images(),
                                                                     trainer_->image_gradients())
                                                 : engine.tiles().count());
    }
    const double drawn = double(reduce.count_nonzero(queue_, engine.splats().tiles_touched));
    const int walked = model_.color.bands(shot.sh_degree, config_.skip.bands).walked;
    cost.work.color_values += share * drawn * 3 * (walked + 1) * (walked + 1);
    Touched& t = cost.work.touched;
    const double moved = double(reduce.count_nonzero(queue_, model_.parameters.rows.seen));
    t.parameters = parameters_of_one(cost.end, config_.skip.bands && shot.sh_degree == 0);
    t.moved += share * moved;
    t.drawn += share * drawn;
    t.intersections += share * double(engine.tiles().intersections);
    const double pixels = double(engine.images().width) * double(engine.images().height);
    t.pixels += share * pixels;
    t.truth_bytes = 3;
  }

  Queue& queue_;
  TrainOptions config_;
  Preparation prepared_;
  Model model_;
  std::unique_ptr<Trainer> trainer_;
  int step_;
};

}  // namespace

Trained warmed_up(Queue& queue, const StepOptions& o, const ScratchFolder& folder, bool quiet) {
  const TrainOptions config = configured(o, Kind());
  Preparation prepared(config, folder.file("frames"));
  prepared.compute_flow(folder.file("flow"), quiet);
  prepared.find_motion_masks();
  Model model(queue, prepared.first_model(queue));
  Trainer trainer = prepared.trainer(queue, model);
  Progress progress("train", o.warm, quiet);
  for (int step = 0; step < o.warm; ++step) {
    trainer.step(queue, step);
    progress.update(step + 1);
    stop_if_interrupted();
  }
  queue.finish();
  return {model.read(queue), trainer.state(queue)};
}

StepOptions with_whole_blocks(StepOptions o, const Trained& from, bool quiet) {
  const TrainOptions config = configured(o, Kind());
  o.counted =
      std::lcm((config.train.focus + 1) * steps_to_flow(config.flow, from.model.shape.motion),
               config.loss.motion_every);
  o.timed = (o.block + o.counted - 1) / o.counted * o.counted;
  if (o.timed != o.block && !quiet)
    print_status(
        "--block {} becomes {}: the same kinds of step in each, which come again after {}\n",
        o.block, o.timed, o.counted);
  return o;
}

int repeats_a_making(const StepOptions& o) { return (o.common.repeats + kMakings - 1) / kMakings; }

std::string blocks_of(const StepOptions& o) {
  return fmt::format("times are of {} steps together", o.timed);
}

std::vector<StepCost> costs_of_steps(Queue& queue, const StepOptions& o,
                                     const std::vector<Kind>& kinds, const Trained& from,
                                     const ScratchFolder& folder) {
  std::vector<StepCost> costs(kinds.size());
  const int repeats = repeats_a_making(o);
  for (int first = 0; first < o.common.repeats; first += repeats) {
    std::vector<std::unique_ptr<GoingOn>> trainings;
    for (const Kind& kind : kinds)
      trainings.push_back(std::make_unique<GoingOn>(queue, o, kind, from, folder));
    for (auto& training : trainings) {  // compiles and decodes
      training->block(o.timed);
      stop_if_interrupted();
    }
    for (size_t i = 0; i < kinds.size(); ++i) trainings[i]->cost = std::move(costs[i]);
    for (int k = 0; k < repeats; ++k)
      for (const size_t i : order_of(trainings.size(), first + k)) {
        trainings[i]->block(o.timed);
        stop_if_interrupted();
      }
    for (size_t i = 0; i < kinds.size(); ++i) costs[i] = trainings[i]->end(o.counted);
  }
  return costs;
}

std::vector<Measurement> shares_of_peaks(const StepCost& cost, const Peak& peak) {
  const double ms = spread_of(cost.wall).median;
  const Channels colour{false, false};
  const double flops = cost.work.pairs.blended * (forward_flops(colour) + backward_flops(colour));
  return {
      single("of the FMA peak, at least [%]", 100e-6 * flops / peak.gflops / ms),
      single("of the copy peak [%]", 100e-6 * bytes_of(cost.work.touched) / peak.copy_gbs / ms)};
}

Plot plot_of(const std::string& name, const std::vector<Kind>& kinds,
             const std::vector<StepCost>& costs) {
  Plot plot;
  plot.name = name;
  plot.table = {{"kind", "CPU [ms]", "lower quartile", "upper quartile"}};
  for (size_t i = 0; i < kinds.size(); ++i) {
    const Spread cpu = spread_of(costs[i].cpu);
    plot.table.push_back({kinds[i].name, fmt::format("{:.4g}", cpu.median),
                          fmt::format("{:.4g}", cpu.low), fmt::format("{:.4g}", cpu.high)});
  }
  plot.script = fmt::format(
      "set termoption noenhanced\nset style data histograms\n"
      "set style histogram errorbars gap 1 lw 1.5\nset style fill solid 0.6\nset yrange [0:*]\n"
      "set ylabel 'CPU time of a training step [ms]'\nset xtics rotate by -25\n"
      "set rmargin 14\nset bmargin 7\n"
      "set key off\nplot '{}.tsv' every ::1 using 2:3:4:xtic(1)",
      name);
  return plot;
}

void add_step_options(CLI::App& bench, StepOptions& options) {
  bench.add_option("SCENE", options.scene, "Folder of the scene, or a video")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  bench.add_option("--set", options.settings, "Training setting; may be repeated")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  bench.add_option("--warm", options.warm, "Training steps before the measurement")
      ->check(number_in(1, 1000000));
  bench
      .add_option("--block", options.block,
                  "Approximate steps timed together; each block has the same mix of whole images, "
                  "parts, flow and motion losses")
      ->check(number_in(1, 100000));
  add_common(bench, options.common);
}

}  // namespace gflow::bench
