// SPDX-License-Identifier: Apache-2.0
// `gflow bench scaling`: cost of an image with flow, its gradients and Adam for more Gaussians,
// pixels, frames and cores; and a prediction for 5 million Gaussians at 3840x2160 on a GPU from
// counted bytes and operations.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "apps/bench/bench.hpp"
#include "apps/bench/measure/pairs.hpp"
#include "apps/bench/measure/whole_step.hpp"
#include "apps/common/command_line.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/usage.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/temporary_folder.hpp"

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

// Least-squares slope of log y over log x; 1 is linear.
double exponent(const std::vector<std::pair<double, double>>& points) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const auto& [x, y] : points) {
    const double u = std::log(x), v = std::log(y);
    n += 1, sx += u, sy += v, sxx += u * u, sxy += u * v;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

// Exponent of the upper half of a sweep, where constant costs are small; or of its last two points.
double exponent_of(const std::vector<Point>& points, const std::string& sweep, bool last_two) {
  std::vector<std::pair<double, double>> all;
  for (const Point& p : points)
    if (p.sweep == sweep) all.emplace_back(p.x, spread_of(p.cost.cpu_ms).median);
  if (all.size() < 2) return 0;  // --most left one point
  const size_t upper = all.size() - all.size() / 2 + (all.size() % 2 == 0);
  all.erase(all.begin(), all.end() - long(last_two ? 2 : upper));
  return exponent(all);
}

// Wall time of this program's raster bench with a limited number of PoCL threads; NaN if
// unavailable.
Spread wall_with_cores(int cores, size_t gaussians, const ScalingOptions& o,
                       const GlobalOptions& options) {
  const ScratchFolder folder("bench");
  const std::string file = folder.file("cores.json");
  // Paths are passed through the environment, so that the shell does not interpret them.
  setenv("GFLOW_BENCH_SELF", std::filesystem::read_symlink("/proc/self/exe").c_str(), 1);
  setenv("GFLOW_BENCH_FILE", file.c_str(), 1);
  if (!options.device.empty()) setenv("GFLOW_DEVICE", options.device.c_str(), 1);
  const std::string command = fmt::format(
      "POCL_MAX_PTHREAD_COUNT={} \"$GFLOW_BENCH_SELF\" bench raster --pixels 512x512 "
      "--gaussians {} --repeats {} --json \"$GFLOW_BENCH_FILE\" > /dev/null 2>&1",
      cores, gaussians, o.common.repeats);
  const int status = std::system(command.c_str());  // Ctrl-C reaches only the child
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : exit_code_of(WTERMSIG(status));
  if (code == exit_code_of(SIGINT)) throw Interrupted("interrupted: the cores were not compared");
  const Spread unknown{NAN, NAN, NAN};
  if (code != 0) return unknown;
  const Bytes bytes = read_file(file);
  const Json report = Json::parse(bytes.begin(), bytes.end());
  if (report["compute_units"] != cores) return unknown;
  const Json& wall = report["rows"][fmt::format("512x512, {}", gaussians)]["wall [ms]"];
  return {wall["median"], wall["low"], wall["high"]};
}

constexpr double kParameters = 50;  // spacetime, SH degree 2

// The predicted scene, and the density to measure for it: pairs per pixel and tiles per Gaussian
// depend on the number of Gaussians per pixel.
constexpr double kGaussians = 5e6, kPixels = 3840.0 * 2160.0;
constexpr int kSide = 512;
constexpr size_t kAsDense = size_t(kGaussians / kPixels * kSide * kSide);

void predict(const ScalingOptions& o, const Point& as_dense, Report& report) {
  const double pairs = as_dense.pairs / (double(kSide) * kSide) * kPixels;
  const double intersections = as_dense.intersections / double(kAsDense) * kGaussians;
  const Channels channels{true, false};
  const double flops_of_pair = forward_flops(channels) + backward_flops(channels);
  const double flops = pairs * flops_of_pair;
  const double bytes = bytes_of({kGaussians, kParameters, kGaussians, intersections, kPixels});
  const double splat_ms =
      spread_of(sum_of(as_dense.cost.kernel_ms, {"splat_fwd", "splat_bwd"})).median;
  const double here = as_dense.pairs * flops_of_pair * 1e-6 / (splat_ms * report.peak().gflops);
  const double compute_ms = flops * 1e-9 / o.gpu_tflops, memory_ms = bytes * 1e-6 / o.gpu_gbs;
  report.add({"5 million, 3840x2160, predicted",
              {single("operations [1e9]", flops * 1e-9), single("bytes [1e9]", bytes * 1e-9),
               single("compute, at peak [ms]", compute_ms),
               single("compute, at the share of peak reached here [ms]", compute_ms / here),
               single("memory, at peak [ms]", memory_ms),
               single("a step, the longer of the last two [ms]",
                      std::max(compute_ms / here, memory_ms))}});
}

// One plot per sweep with its own axes, and a line of proportional scaling. `table` rows: sweep, x,
// ms.
Plot plot_of(std::vector<std::vector<std::string>> table) {
  Plot plot;
  plot.name = "scaling";
  plot.height = 800;
  plot.script =
      "set key inside top left\nset format xy '10^{%L}'\nset logscale xy\n"
      "set multiplot layout 2,2\n";
  for (size_t first = 1, end; first < table.size(); first = end) {  // skips the headings
    const std::string sweep = table[first][0];
    for (end = first; end < table.size() && table[end][0] == sweep;) ++end;
    const std::vector<std::string>&from = table[first], &to = table[end - 1];
    const bool cores = sweep == "cores";
    plot.script += fmt::format(
        "set xlabel '{0}'\nset ylabel '{1} time [ms]'\n{2}plot sample [{3}:{4}] {5} with lines "
        "dashtype 2 linecolor 'gray40' title '{6}', 'scaling.tsv' every ::1 using "
        "(strcol(1) eq '{0}' ? $2 : 1/0):3 with linespoints pointtype 7 linecolor 1 notitle\n",
        sweep, cores ? "wall" : "CPU",
        cores ? "unset logscale\nset key top right\nset format xy '%g'\nset yrange [0:*]\nset "
                "xtics 1\n"
              : "",
        cores ? from[1] : fmt::format("{}/10.", to[1]), to[1],
        cores ? fmt::format("{}*{}/x", from[2], from[1]) : fmt::format("{}*x/{}", to[2], to[1]),
        cores ? "in proportion" : "linear");
  }
  plot.script += "unset multiplot";
  plot.table = std::move(table);
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
  for (const int side : {128, 256, 512, 1024})
    points.push_back(measured(queue, o, "pixels", double(side) * side, side,
                              std::min<size_t>(o.most, 30000), 1));
  for (const size_t frames : {1, 3, 10, 30, 100})
    points.push_back(
        measured(queue, o, "frames", double(frames), 256, std::min<size_t>(o.most, 10000), frames));
  for (const Point& p : points)
    report.add({fmt::format("{}: {}", p.sweep, p.x),
                {{"CPU [ms]", spread_of(p.cost.cpu_ms)},
                 {"wall [ms]", spread_of(p.cost.wall_ms)},
                 single("intersections", p.intersections),
                 single("blended pairs", p.pairs),
                 single("peak memory [MiB]", p.peak_mib)}});
  for (const char* sweep : {"Gaussians", "pixels", "frames"})
    if (exponent_of(points, sweep, true) != 0)
      report.add({fmt::format("time with {}", sweep),
                  {single("exponent, upper half", exponent_of(points, sweep, false)),
                   single("of the last two", exponent_of(points, sweep, true))}});
  std::vector<std::vector<std::string>> plotted{{"sweep", "x", "ms"}};
  for (const Point& p : points)
    plotted.push_back({p.sweep, fmt::format("{:.0f}", p.x),
                       fmt::format("{:.4g}", spread_of(p.cost.cpu_ms).median)});
  if (queue.info.is_cpu) {
    const size_t gaussians = std::min<size_t>(o.most, 100000);
    const Spread one = wall_with_cores(1, gaussians, o, options);
    for (int cores = 1; cores <= int(queue.info.compute_units); cores *= 2) {
      const Spread wall = cores == 1 ? one : wall_with_cores(cores, gaussians, o, options);
      if (!std::isfinite(wall.median)) continue;
      report.add({fmt::format("512x512, {} on {} core{}", gaussians, cores, cores > 1 ? "s" : ""),
                  {{"wall [ms]", wall}, single("of one core", wall.median / one.median)}});
      plotted.push_back({"cores", std::to_string(cores), fmt::format("{:.4g}", wall.median)});
    }
  }
  predict(o, measured(queue, o, "as dense", double(kAsDense), kSide, kAsDense, 1), report);
  report.measure_peak_again(queue);
  return {std::move(report), {plot_of(std::move(plotted))}};
}

}  // namespace

void add_scaling(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<ScalingOptions>();
  flags->common.repeats = 5;
  CLI::App* scaling = bench.add_subcommand(
      "scaling", "Cost against Gaussians, pixels, frames and cores, and a prediction for a GPU");
  scaling->add_option("--most", flags->most, "Maximum number of Gaussians")
      ->check(number_in(1000, 20000000));
  scaling
      ->add_option("--gpu-tflops", flags->gpu_tflops,
                   "Speed of the predicted GPU: 1e12 operations/s, an FMA counts as two")
      ->check(number_in(0.01, 1e6));
  scaling
      ->add_option("--gpu-gbs", flags->gpu_gbs,
                   "Memory bandwidth of the predicted GPU: 1e9 bytes/s")
      ->check(number_in(0.1, 1e6));
  add_common(*scaling, flags->common);
  scaling->callback(
      [flags, &options] { deliver(flags->common, [&] { return run_scaling(*flags, options); }); });
}

}  // namespace gflow::bench
