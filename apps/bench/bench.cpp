// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/bench.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <sstream>

#include "apps/common/command_line.hpp"
#include "apps/common/output_path.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace bench {

namespace {

// Checks output paths before anything is measured.
void check_outputs(const BenchOptions& options) {
  require_writable("--json", options.json);
  require_writable("--markdown", options.markdown);
  if (options.plots.empty()) return;
  std::error_code problem;
  std::filesystem::create_directories(options.plots, problem);
  if (problem)
    throw Error(fmt::format("drawing into {}: cannot create that folder: {}", options.plots,
                            problem.message()));
  require_writable("--plots", (std::filesystem::path(options.plots) / "plot.svg").string());
}

}  // namespace

void add_common(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--repeats", options.repeats, "Measured runs; medians are reported")
      ->check(number_in(1, 1000));
  bench.add_option("--json", options.json, "Write the measurements to this file")
      ->check(path_given())
      ->type_name("FILE");
  bench.add_option("--plots", options.plots, "Write plots into this folder (gnuplot)")
      ->check(path_given())
      ->type_name("DIR");
  bench
      .add_option("--compare", options.compare,
                  "Print ratios to an earlier --json FILE; if one is above 1.1 beyond the "
                  "quartiles (of CPU time, if available), measure again; exit code 3 if it remains")
      ->type_name("FILE")
      ->check(CLI::Validator(
          [name = bench.get_name()](const std::string& path) -> std::string {
            try {
              read_report(path, name);
            } catch (const Error& problem) {
              return problem.what();
            }
            return "";
          },
          ""));
}

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted("interrupted: no measurement was completed");
}

std::pair<int, int> size_named(const std::string& option, const std::string& text) {
  int width = 0, height = 0;
  char x = 0, more = 0;
  std::istringstream in(text);
  if (!(in >> width >> x >> height) || x != 'x' || in >> more || width < 1 || height < 1 ||
      width > 16384 || height > 16384)
    throw Error(fmt::format("{} {}: expected a size such as 512x512", option, text));
  return {width, height};
}

void deliver(const BenchOptions& options, const std::function<Result()>& measure) {
  check_outputs(options);
  const Result result = measure();
  result.report.print();
  std::fflush(stdout);  // keeps the report if plotting is interrupted
  if (!options.json.empty())
    write_file_atomically(options.json, std::string_view(result.report.json().dump(1) + "\n"));
  if (!options.markdown.empty())
    write_file_atomically(options.markdown, std::string_view(result.markdown));
  if (!options.plots.empty())
    for (const Plot& plot : result.plots) print_result("plot: {}\n", draw(plot, options.plots));
  if (options.compare.empty()) return;
  std::vector<std::string> worse = result.report.compare();
  if (worse.empty()) return;
  print_result("{} worse than in {}: measured once more\n", worse.size(), options.compare);
  const std::vector<std::string> again = measure().report.compare();
  worse.erase(std::remove_if(worse.begin(), worse.end(),
                             [&](const std::string& name) {
                               return std::find(again.begin(), again.end(), name) == again.end();
                             }),
              worse.end());
  if (worse.empty()) return;
  print_result("{} worse than in {}, twice: {}\n", worse.size(), options.compare,
               fmt::join(worse, "; "));
  throw CLI::RuntimeError(3);
}

}  // namespace bench

void add_bench(CLI::App& app, const GlobalOptions& options) {
  CLI::App* bench = app.add_subcommand("bench", "Measure the cost of gflow on this device");
  bench->require_subcommand(1);
  bench::add_raster(*bench, options);
  bench::add_pareto(*bench, options);
  bench::add_scaling(*bench, options);
#ifdef GFLOW_WITH_OPENCV
  bench::add_step(*bench, options);
  bench::add_skip(*bench, options);
#endif
}

}  // namespace gflow
