// SPDX-License-Identifier: Apache-2.0
// `gflow bench raster`: what the engine costs, stage by stage, on random splats. The scene: means
// uniform in the picture, anisotropic, opacities sigmoid(N(-0.2, 1.5)), sizes such that a pixel has
// about 48 contributors, whatever the number of Gaussians. CPU time stands beside wall time,
// because on a shared machine only the former says what the work costs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <random>

#include "apps/command_line.hpp"
#include "apps/options.hpp"
#include "optim/engine/engine.hpp"
#include "runtime/usage.hpp"

namespace gflow {
namespace {

struct BenchOptions {
  int width = 512, height = 512, gaussians = 100000, repeats = 15, lanes = 0;
  bool no_flow = false, depth = false, kernels = false;
};

// The projected shape of one splat: covariance before the dilation, opacity.
struct Shape {
  double x, y, xx, xy, yy, opacity;
};

std::vector<Shape> shapes(const BenchOptions& o, double scale) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<Shape> all(size_t(o.gaussians));
  for (Shape& s : all) {
    s.x = uniform(rng) * (o.width + 16) - 8;
    s.y = uniform(rng) * (o.height + 16) - 8;
    const double size = scale * std::exp(0.5 * normal(rng));
    const double aspect = std::exp(0.5 * std::fabs(normal(rng))), turn = uniform(rng) * M_PI;
    const double a = size * size * aspect, b = size * size / aspect;
    const double c = std::cos(turn), d = std::sin(turn);
    s.xx = a * c * c + b * d * d;
    s.yy = a * d * d + b * c * c;
    s.xy = (a - b) * c * d;
    s.opacity = 1 / (1 + std::exp(0.2 - 1.5 * normal(rng)));
  }
  return all;
}

// Expected contributors a pixel, were nothing saturated: sum of ellipse areas over the picture.
double coverage(const BenchOptions& o, double scale) {
  double area = 0;
  for (const Shape& s : shapes(o, scale)) {
    const double reach = 2 * std::log(255 * s.opacity);
    const double xx = s.xx + DILATION, yy = s.yy + DILATION;
    if (reach > 0) area += M_PI * reach * std::sqrt(xx * yy - s.xy * s.xy);
  }
  return area / ((o.width + 16.0) * (o.height + 16.0));
}

double scale_for(const BenchOptions& o, double contributors) {
  double low = 0.05, high = 60;
  for (int i = 0; i < 12; ++i) {
    const double middle = std::sqrt(low * high);
    (coverage(o, middle) < contributors ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

// Gaussians in front of a camera at the origin that project to those shapes: the third row of each
// factor is 0, so that M = f/z times its first two rows.
struct BenchScene {
  View view;
  GaussiansAt t1, t2;
  Buffer<float> colors{"colors"};
};

BenchScene make_scene(Queue& queue, const BenchOptions& o) {
  const std::vector<Shape> all = shapes(o, scale_for(o, 50));
  const float f = float(o.width);
  BenchScene scene;
  PinholeCamera& camera = scene.view.camera;
  camera = PinholeCamera{};
  camera.rotation[0] = camera.rotation[4] = camera.rotation[8] = 1;
  camera.fx = camera.fy = f;
  camera.cx = 0.5f * float(o.width);
  camera.cy = 0.5f * float(o.height);
  camera.near_plane = 0.01f;
  camera.width = o.width;
  camera.height = o.height;
  scene.view.camera_t2 = camera;
  std::mt19937 rng(2);
  std::uniform_real_distribution<float> uniform;
  std::vector<float> means, factors, opacities, colors, means2, factors2;
  for (const Shape& s : all) {
    const float z = 1 + 9 * uniform(rng), unit = z / f;
    const float x = (float(s.x) - camera.cx) * unit, y = (float(s.y) - camera.cy) * unit;
    means.insert(means.end(), {x, y, z});
    means2.insert(means2.end(), {x + unit * (uniform(rng) - 0.5f), y + unit, z});
    const float l11 = float(std::sqrt(s.xx)), l21 = float(s.xy / std::sqrt(s.xx));
    const float l22 = float(std::sqrt(std::max(s.yy - s.xy * s.xy / s.xx, 0.0)));
    for (const float grow : {1.f, 1.05f})
      for (const float v : {l11, 0.f, 0.f, l21, l22, 0.f, 0.f, 0.f, 0.f})
        (grow == 1.f ? factors : factors2).push_back(v * unit * grow);
    opacities.push_back(float(s.opacity));
    for (int c = 0; c < 3; ++c) colors.push_back(uniform(rng));
  }
  scene.t1.ensure(queue, all.size());
  scene.t2.ensure(queue, all.size());
  scene.t1.means.write(queue, means);
  scene.t1.factors.write(queue, factors);
  scene.t1.opacities.write(queue, opacities);
  scene.t2.means.write(queue, means2);
  scene.t2.factors.write(queue, factors2);
  scene.t2.opacities.write(queue, opacities);
  scene.colors = Buffer<float>(queue, colors, "colors");
  return scene;
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v.empty() ? 0 : v[v.size() / 2];
}

// The kernels of each stage, in the order they run.
const std::vector<std::pair<std::string, std::vector<std::string>>> stages{
    {"project", {"project_fwd"}},
    {"bin",
     {"scan_sums", "scan_offsets", "scan_write", "sort_count", "sort_scatter", "tile_count",
      "tile_columns", "tile_scatter"}},
    {"mask", {"cell_mask"}},
    {"splat", {"splat_fwd"}},
    {"backward", {"splat_bwd"}},
    {"gather", {"gather"}},
    {"project back", {"project_bwd"}}};

void run_raster(const BenchOptions& o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  queue_options.lanes = o.lanes;
  Queue queue = open_queue(options, queue_options);
  const BenchScene scene = make_scene(queue, o);
  const size_t pixels = size_t(o.width) * size_t(o.height);
  ImageGradients v;
  std::mt19937 rng(7);
  std::normal_distribution<float> normal;
  const auto noise = [&](size_t n) {
    std::vector<float> values(n);
    for (float& value : values) value = normal(rng);
    return values;
  };
  v.v_rgb = Buffer<float>(queue, noise(3 * pixels), "v_rgb");
  v.v_alpha = Buffer<float>(queue, noise(pixels), "v_alpha");
  v.v_flow = Buffer<float>(queue, noise(2 * pixels), "v_flow");
  if (o.depth) v.v_depth = Buffer<float>(queue, noise(pixels), "v_depth");
  Engine engine(queue);
  GaussianGradients gradients;
  std::map<std::string, std::vector<double>> ms, kernel_ms;
  std::vector<double> wall, cpu;
  for (int i = 0; i < o.repeats + 2; ++i) {
    queue.finish();
    queue.reset_timings();
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = cpu_seconds();
    engine.forward(queue, scene.view, {!o.no_flow, o.depth}, {0, 0, 0}, scene.t1, scene.t2,
                   scene.colors);
    engine.backward(queue, scene.t1, scene.t2, v, gradients);
    queue.finish();
    if (i < 2) continue;  // compiling, growing buffers
    cpu.push_back(1e3 * (cpu_seconds() - cpu_start));
    wall.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    const auto& timings = queue.timings();
    for (const auto& [stage, kernels] : stages) {
      double sum = 0;
      for (const std::string& kernel : kernels)
        if (timings.count(kernel)) {
          sum += timings.at(kernel).total_ms;
          kernel_ms[kernel].push_back(timings.at(kernel).total_ms);
        }
      ms[stage].push_back(sum);
    }
  }
  fmt::print(
      "{}, {} lanes, {} x {} pixels, {} Gaussians, {} intersections, flow {}, depth"
      " {}\n",
      queue.info.full_name(), queue.lanes, o.width, o.height, o.gaussians,
      engine.tiles().intersections, o.no_flow ? "off" : "on", o.depth ? "on" : "off");
  fmt::print("medians of {} [ms]; stages: time on the device\n", o.repeats);
  for (const auto& [stage, kernels] : stages) {
    fmt::print("  {:<14}{:8.2f}\n", stage, median(ms[stage]));
    if (!o.kernels || kernels.size() == 1) continue;
    for (const std::string& kernel : kernels)
      fmt::print("    {:<20}{:8.3f}\n", kernel, median(kernel_ms[kernel]));
  }
  fmt::print("  {:<14}{:8.2f}  CPU time {:.2f}, half of it {:.2f}\n", "all, wall", median(wall),
             median(cpu), median(cpu) / 2);
  fmt::print("  peak memory   {:8.0f} MiB\n", peak_memory_mib());
}

}  // namespace

void add_bench(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<BenchOptions>();
  CLI::App* bench = app.add_subcommand("bench", "Measure what the engine costs on this device");
  CLI::App* raster = bench->add_subcommand("raster", "One image and its gradients, by stage");
  raster->add_option("--width", flags->width, "Of the image [px]")->check(number_in(1, 16384));
  raster->add_option("--height", flags->height, "Of the image [px]")->check(number_in(1, 16384));
  raster->add_option("--gaussians", flags->gaussians, "How many")->check(number_in(1, 20000000));
  raster->add_option("--repeats", flags->repeats, "Measured runs")->check(number_in(1, 1000));
  raster->add_option("--lanes", flags->lanes, "Pixels a work-item: 16, 8, 4, 1; 0: the device's")
      ->check(choice_of({"0", "1", "4", "8", "16"}));
  raster->add_flag("--no-flow", flags->no_flow, "No flow image");
  raster->add_flag("--depth", flags->depth, "Expected depth as well");
  raster->add_flag("--kernels", flags->kernels, "Show the kernels of each stage");
  bench->require_subcommand(1);
  raster->callback([flags, &options] { run_raster(*flags, options); });
}

}  // namespace gflow
