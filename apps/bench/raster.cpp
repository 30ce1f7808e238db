// SPDX-License-Identifier: Apache-2.0
// `gflow bench raster`: an image and its gradients, stage by stage, from the parameters of moving
// Gaussians to Adam.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <set>

#include "apps/bench/bench.hpp"
#include "apps/bench/measure/pairs.hpp"
#include "apps/bench/measure/whole_step.hpp"
#include "apps/common/command_line.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/primitives/reduce.hpp"

namespace gflow::bench {
namespace {

struct RasterOptions {
  BenchOptions common;
  std::string file;
  std::vector<std::string> sizes{"256x256", "512x512"};
  std::vector<size_t> gaussians{10000, 100000};
  int lanes = 0;
  size_t frames = 1;
  bool no_flow = false, depth = false, kernels = false, grid = false;
};

// The kernels of each stage, in execution order. The prefix sum of `cull` counts in `bin`, whose
// kernels it shares.
const std::vector<std::pair<std::string, std::vector<std::string>>> stages{
    {"cull", {"spacetime_cull", "view_rows_write"}},
    {"motion", {"spacetime_fwd"}},
    {"project", {"project_fwd"}},
    {"bin",
     {"seen_count", "seen_write", "scan_sums", "scan_offsets", "scan_write", "sort_count",
      "sort_scatter", "tile_count", "tile_columns", "tile_scatter"}},
    {"mask", {"cell_mask"}},
    {"transport", {"transport_fwd"}},
    {"splat", {"splat_fwd"}},
    {"backward", {"splat_bwd"}},
    {"gather", {"gather"}},
    {"project back", {"project_bwd"}},
    {"motion back", {"spacetime_bwd"}},
    {"Adam", {"adam_refuse", "adam_advance", "adam_step"}}};

// Half the CPU time from bin to gather, the rasterizer alone: its wall time on two idle cores. NaN
// on a GPU.
Measurement half_of_raster(const Queue& queue, const Cost& cost) {
  const char* const name = "bin to gather, of that [ms]";
  if (!queue.info.is_cpu) return single(name, NAN);
  KernelSamples raster;
  for (const auto& [stage, kernels] : stages)
    for (const char* one : {"bin", "mask", "transport", "splat", "backward", "gather"})
      if (stage == one) raster[stage] = sum_of(cost.kernel_ms, kernels);
  return {name,
          scaled(spread_of(cpu_of(sum_of(raster), sum_of(cost.kernel_ms), cost.cpu_ms)), 0.5)};
}

void measure(Queue& queue, BenchScene scene, const RasterOptions& o, Report& report,
             std::vector<std::vector<std::string>>& shares) {
  const Channels channels{!o.no_flow, o.depth};
  WholeStep step(queue, scene, channels);
  const Cost cost = cost_of(queue, o.common.repeats, [&] { step(); });
  const Pairs pairs = count_pairs(queue, step.engine(), {});
  const double pixels = double(scene.view.camera.width) * scene.view.camera.height;
  const auto flops_of = [&](const std::string& stage) {
    if (stage == "splat") return forward_flops(channels);
    return stage == "backward" ? backward_flops(channels) : 0;
  };
  report.add({scene.name,
              {{"wall [ms]", spread_of(cost.wall_ms)},
               {"CPU [ms]", spread_of(cost.cpu_ms)},
               {"half the CPU time [ms]", scaled(spread_of(cost.cpu_ms), 0.5)},
               half_of_raster(queue, cost),
               single("intersections", double(step.engine().tiles().intersections)),
               single("listed a pixel", pairs.listed / pixels),
               single("masked a pixel", pairs.masked / pixels),
               single("blended a pixel", pairs.blended / pixels),
               single("peak memory [MiB]", peak_memory_mib())}});
  const Samples all = sum_of(cost.kernel_ms);
  Reduce reduce(queue);
  const double drawn = double(reduce.count_nonzero(queue, step.engine().splats().tiles_touched));
  Touched touched{drawn, 0, drawn, double(step.engine().tiles().intersections), pixels};
  if (scene.parameters)
    for (const ParameterGroup& group : scene.parameters->groups)
      touched.parameters += double(group.width);
  const auto row = [&](const std::string& name, const Samples& times, double flops) {
    const Spread ms = spread_of(times);
    // Operations or bytes in 1e9 per second, time in ms: factor 1e-6.
    const double share = flops * pairs.blended * 1e-6 / report.peak().gflops;
    report.add({scene.name + ": " + name,
                {{"device [ms]", ms},
                 queue.info.is_cpu
                     ? Measurement{"CPU, about [ms]", spread_of(cpu_of(times, all, cost.cpu_ms))}
                     : single("CPU, about [ms]", NAN),
                 {"a blended pair [ns]", scaled(ms, 1e6 / pairs.blended)},
                 // Operations are counted only for splat and backward.
                 single("of the FMA peak [%]", flops > 0 ? 100 * share / ms.median : NAN),
                 single("of the copy peak [%]", 100e-6 * bytes_of_stage(name, touched, channels) /
                                                    report.peak().copy_gbs / ms.median)},
                is_brief(times, all)});
  };
  shares.push_back({scene.name});
  for (const auto& [stage, kernels] : stages) {
    const Samples times = sum_of(cost.kernel_ms, kernels);
    shares.back().push_back(fmt::format("{:.3f}", 100 * ratio_of(times, all).median));
    if (times.empty()) continue;
    row(stage, times, flops_of(stage));
    if (!o.kernels || kernels.size() < 2) continue;
    for (const std::string& kernel : kernels)
      if (cost.kernel_ms.count(kernel)) row(kernel, cost.kernel_ms.at(kernel), 0);
  }
}

struct Case {
  std::string size;
  size_t gaussians;
};

// Cases with random Gaussians, each once. A single size goes with every number, and vice versa.
std::vector<Case> cases_of(const RasterOptions& o) {
  const size_t sizes = o.sizes.size(), numbers = o.gaussians.size();
  const bool each = o.grid || sizes == 1 || numbers == 1;
  if (!each && sizes != numbers)
    throw Error(
        fmt::format("--pixels has {} sizes and --gaussians {} numbers: give as many of "
                    "both, or --grid for each with each",
                    sizes, numbers));
  std::vector<Case> cases;
  std::set<std::pair<std::string, size_t>> known;
  for (size_t i = 0; i < sizes; ++i)
    for (size_t k = 0; k < numbers; ++k) {
      if (!each && i != k) continue;
      if (!known.insert({o.sizes[i], o.gaussians[k]}).second)
        throw Error(fmt::format("--pixels {} with --gaussians {} is asked for twice", o.sizes[i],
                                o.gaussians[k]));
      size_named("--pixels", o.sizes[i]);
      cases.push_back({o.sizes[i], o.gaussians[k]});
    }
  return cases;
}

Result run_raster(const RasterOptions& o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  queue_options.lanes = o.lanes;
  Queue queue = open_queue(options, queue_options);
  Report report("raster", queue,
                {{"flow", !o.no_flow},
                 {"depth", o.depth},
                 {"scene", o.file},
                 {"frames", o.frames},
                 {"repeats", o.common.repeats}},
                o.common.compare);
  std::vector<std::vector<std::string>> shares{{"scene"}};
  for (const auto& [stage, kernels] : stages) shares[0].push_back(stage);
  if (!o.file.empty()) {
    begin_peak_memory();
    measure(queue, scene_of_file(queue, o.file, !o.no_flow), o, report, shares);
  } else {
    for (const Case& one : cases_of(o)) {
      const auto [width, height] = size_named("--pixels", one.size);
      begin_peak_memory();
      measure(queue, random_scene(queue, width, height, one.gaussians, o.frames), o, report,
              shares);
    }
  }
  report.measure_peak_again(queue);
  return {std::move(report), {bars("raster", "share of the device time [%]", std::move(shares))}};
}

}  // namespace

void add_raster(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<RasterOptions>();
  CLI::App* raster = bench.add_subcommand(
      "raster", "One image of moving Gaussians and its gradients, stage by stage");
  CLI::Option* const file =
      raster
          ->add_option("SCENE", flags->file,
                       "Gaussians as for `gflow splat`; default: random ones, about 48 per pixel")
          ->check(path_given())
          ->type_name("FILE.npz");
  // Options of random scenes only.
  CLI::Option* const random[] = {
      raster->add_option("--pixels", flags->sizes, "Image sizes: one, or as many as --gaussians")
          ->delimiter(',')
          ->check(list_entry())
          ->type_name("WxH,..."),
      raster
          ->add_option("--gaussians", flags->gaussians, "Number of Gaussians: one, or one per size")
          ->delimiter(',')
          ->check(list_entry())
          ->check(number_in(1, 20000000))
          ->type_name("N,..."),
      raster
          ->add_option("--frames", flags->frames,
                       "Frames, each with this number of Gaussians; the middle one is rendered")
          ->check(number_in(1, 1000)),
      raster->add_flag("--grid", flags->grid, "Combine each size with each number of Gaussians")};
  for (CLI::Option* option : random) file->excludes(option);
  raster
      ->add_option("--lanes", flags->lanes,
                   "Pixels per work-item: 16, 8, 4, 1; 0: chosen for the device")
      ->check(choice_of({"0", "1", "4", "8", "16"}));
  raster->add_flag("--no-flow", flags->no_flow, "No flow image");
  raster->add_flag("--depth", flags->depth, "Also render expected depth");
  raster->add_flag("--kernels", flags->kernels, "Print the kernels of each stage");
  add_common(*raster, flags->common);
  raster->callback([flags, &options] {
    if (flags->file.empty()) cases_of(*flags);  // checks the cases before anything is measured
    deliver(flags->common, [&] { return run_raster(*flags, options); });
  });
}

}  // namespace gflow::bench
