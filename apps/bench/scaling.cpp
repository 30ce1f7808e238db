// SPDX-License-Identifier: Apache-2.0
// `gflow bench scaling`: what an image with flow, its gradients and Adam cost with more Gaussians,
// pixels, frames and cores; and what 5 million at 3840x2160 would take on a GPU, from counted bytes
// and operations.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "apps/bench/bench.hpp"
#include "apps/bench/pairs.hpp"
#include "apps/bench/scratch_folder.hpp"
#include "apps/bench/whole_step.hpp"
#include "apps/command_line.hpp"
#include "optim/io/atomic_file.hpp"
#include "optim/io/interrupt.hpp"
#include "runtime/usage.hpp"

namespace gflow::bench {
namespace {

struct ScalingOptions {
  BenchOptions common;
  size_t most = 1000000;
  double gpu_tflops = 82.6, gpu_gbs = 1008;  // NVIDIA RTX 4090, by its data sheet
};

struct Point {
  std::string sweep;
  double x;  // Gaussians, pixels, frames or cores
  Cost cost;
  double pairs, intersections, peak_mib;
};

Point measured(Queue& queue, const ScalingOptions& o, const std::string& sweep, double x, int side,
               size_t gaussians, size_t frames) {
  begin_peak_memory();
  BenchScene scene = random_scene(queue, side, side, gaussians, frames);
  WholeStep step(queue, scene, {true, false});
  Point p{sweep, x, cost_of(queue, o.common.repeats, [&] { step(); }), 0, 0, 0};
  p.pairs = count_pairs(queue, step.engine(), {}).blended;
  p.intersections = double(step.engine().tiles().intersections);
  p.peak_mib = peak_memory_mib();
  return p;
}

// The slope of log y over log x, by least squares: 1 is linear.
double exponent(const std::vector<std::pair<double, double>>& points) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const auto& [x, y] : points) {
    const double u = std::log(x), v = std::log(y);
    n += 1, sx += u, sy += v, sxx += u * u, sxy += u * v;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

// Of the upper half of a sweep, where what does not grow is small.
double exponent_of(const std::vector<Point>& points, const std::string& sweep) {
  std::vector<std::pair<double, double>> all;
  for (const Point& p : points)
    if (p.sweep == sweep) all.emplace_back(p.x, spread_of(p.cost.cpu_ms).median);
  if (all.size() < 2) return 0;  // --most left one
  all.erase(all.begin(), all.begin() + long(all.size() / 2) - (all.size() % 2 == 0));
  return exponent(all);
}

// The program itself with so many of PoCL's threads; the wall time of its raster bench, or NaN.
double wall_with_cores(int cores, size_t gaussians, const ScalingOptions& o,
                       const GlobalOptions& options) {
  const ScratchFolder folder;
  const std::string file = folder.file("cores.json");
  // Names go through the environment, so that none is read by the shell.
  setenv("GFLOW_BENCH_SELF", std::filesystem::read_symlink("/proc/self/exe").c_str(), 1);
  setenv("GFLOW_BENCH_FILE", file.c_str(), 1);
  if (!options.device.empty()) setenv("GFLOW_DEVICE", options.device.c_str(), 1);
  const std::string command = fmt::format(
      "POCL_MAX_PTHREAD_COUNT={} \"$GFLOW_BENCH_SELF\" bench raster --pixels 512x512 --gaussians "
      "{} "
      "--repeats {} --json \"$GFLOW_BENCH_FILE\" > /dev/null 2>&1",
      cores, gaussians, o.common.repeats);
  const int status = std::system(command.c_str());  // Ctrl-C reaches that one alone
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : exit_code_of(WTERMSIG(status));
  if (code == exit_code_of(SIGINT)) throw Interrupted("interrupted: the cores were not compared");
  if (code != 0) return NAN;
  const Bytes bytes = read_file(file);
  const Json report = Json::parse(bytes.begin(), bytes.end());
  if (report["compute_units"] != cores) return NAN;
  return report["rows"][fmt::format("512x512, {}", gaussians)]["wall [ms]"]["median"];
}

constexpr double kParameters = 50;  // spacetime, colour of degree 2

void predict(const ScalingOptions& o, const Point& largest, double peak_gflops, Report& report) {
  const double gaussians = 5e6, pixels = 3840.0 * 2160.0;
  // So many are as small as pixels: a tile or two each; pairs a pixel as measured.
  const double pairs = largest.pairs / (512 * 512) * pixels;
  const double intersections =
      std::max(1.5 * gaussians, largest.intersections / largest.x * gaussians);
  const Channels channels{true, false};
  const double flops = pairs * (forward_flops(channels) + backward_flops(channels));
  const double bytes = bytes_of({gaussians, kParameters, gaussians, intersections, pixels});
  const double splat_ms =
      spread_of(sum_of(largest.cost.kernel_ms, {"splat_fwd", "splat_bwd"})).median;
  const double here = largest.pairs * (forward_flops(channels) + backward_flops(channels)) * 1e-6 /
                      (splat_ms * peak_gflops);
  const double compute_ms = flops * 1e-9 / o.gpu_tflops, memory_ms = bytes * 1e-6 / o.gpu_gbs;
  report.add({"5 million, 3840x2160, predicted",
              {single("operations [1e9]", flops * 1e-9), single("bytes [1e9]", bytes * 1e-9),
               single("compute, at peak [ms]", compute_ms),
               single("compute, at the share of peak reached here [ms]", compute_ms / here),
               single("memory, at peak [ms]", memory_ms)}});
}

Plot plot_of(const std::vector<Point>& points) {
  Plot plot;
  plot.name = "scaling";
  plot.table = {{"sweep", "x", "CPU [ms]"}};
  for (const Point& p : points)
    plot.table.push_back({p.sweep, fmt::format("{:.0f}", p.x),
                          fmt::format("{:.4g}", spread_of(p.cost.cpu_ms).median)});
  plot.script =
      "set logscale xy\nset xlabel 'how many'\nset ylabel 'CPU time of an image with flow, its "
      "gradients and Adam [ms]'\nplot for [s in 'Gaussians pixels frames'] 'scaling.tsv' every ::1 "
      "using (strcol(1) eq s ? $2 : 1/0):3 with linespoints pt 7 title s";
  return plot;
}

Result run_scaling(const ScalingOptions& o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  Queue queue = open_queue(options, queue_options);
  Report report("scaling", queue, {{"most", o.most}, {"repeats", o.common.repeats}},
                o.common.compare);
  std::vector<Point> points;
  for (size_t n = 1000; n <= o.most; n = n % 3 == 0 ? n / 3 * 10 : n * 3)
    points.push_back(measured(queue, o, "Gaussians", double(n), 512, n, 1));
  const Point largest = points.back();
  for (const int side : {128, 256, 512, 1024})
    points.push_back(measured(queue, o, "pixels", double(side) * side, side,
                              std::min<size_t>(o.most, 30000), 1));
  for (const size_t frames : {1, 3, 10, 30, 100})
    points.push_back(
        measured(queue, o, "frames", double(frames), 256, std::min<size_t>(o.most, 10000), frames));
  for (const Point& p : points)
    report.add({fmt::format("{} {}", p.x, p.sweep),
                {{"CPU [ms]", spread_of(p.cost.cpu_ms)},
                 {"wall [ms]", spread_of(p.cost.wall_ms)},
                 single("intersections", p.intersections),
                 single("blended pairs", p.pairs),
                 single("peak memory [MiB]", p.peak_mib)}});
  for (const char* sweep : {"Gaussians", "pixels", "frames"})
    if (exponent_of(points, sweep) != 0)
      report.add({fmt::format("time with {}", sweep),
                  {single("exponent, upper half", exponent_of(points, sweep))}});
  if (queue.info.is_cpu) {
    const size_t gaussians = std::min<size_t>(o.most, 100000);
    const double one = wall_with_cores(1, gaussians, o, options);
    for (int cores = 1; cores <= int(queue.info.compute_units); cores *= 2) {
      const double wall = cores == 1 ? one : wall_with_cores(cores, gaussians, o, options);
      if (std::isfinite(wall))
        report.add({fmt::format("512x512, {} on {} cores", gaussians, cores),
                    {single("wall, once [ms]", wall), single("of one core", wall / one)}});
    }
  }
  predict(o, largest, report.peak().gflops, report);
  return {std::move(report), plot_of(points)};
}

}  // namespace

void add_scaling(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<ScalingOptions>();
  flags->common.repeats = 5;
  CLI::App* scaling = bench.add_subcommand(
      "scaling", "Cost against Gaussians, pixels, frames and cores, and what a GPU would take");
  scaling->add_option("--most", flags->most, "Most Gaussians tried")
      ->check(number_in(1000, 20000000));
  scaling
      ->add_option("--gpu-tflops", flags->gpu_tflops,
                   "Of the GPU that is predicted: 1e12 operations/s, an FMA being two")
      ->check(number_in(0.01, 1e6));
  scaling->add_option("--gpu-gbs", flags->gpu_gbs, "And its memory: 1e9 bytes/s")
      ->check(number_in(0.1, 1e6));
  add_common(*scaling, flags->common);
  scaling->callback(
      [flags, &options] { deliver(flags->common, [&] { return run_scaling(*flags, options); }); });
}

}  // namespace gflow::bench
