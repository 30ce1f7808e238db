// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/bench.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <sstream>

#include "apps/command_line.hpp"
#include "optim/io/atomic_file.hpp"
#include "optim/io/interrupt.hpp"

namespace gflow {
namespace bench {

namespace {

// Why this is no report of the bench, or "". Before anything is measured.
std::string no_report(const std::string& path, const std::string& bench) {
  try {
    const Bytes bytes = read_file(path);
    const Json json = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
    const bool is_one = json.is_object() && json.contains("bench") && json["bench"] == bench &&
                        json.contains("rows") && json["rows"].is_object();
    return is_one ? "" : fmt::format("{}: it is no report of `gflow bench {}`", path, bench);
  } catch (const Error& problem) {
    return problem.what();
  }
}

}  // namespace

void add_common(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--repeats", options.repeats, "Measured runs; medians are told")
      ->check(number_in(1, 1000));
  bench.add_option("--json", options.json, "Write what was measured here")->type_name("FILE");
  bench.add_option("--plots", options.plots, "Draw it, into this folder (gnuplot)")
      ->type_name("DIR");
  bench
      .add_option("--compare", options.compare,
                  "Show ratios to an earlier --json FILE; those above 1.1 are marked and make the "
                  "exit code 3")
      ->type_name("FILE")
      ->check(CLI::Validator(
          [name = bench.get_name()](const std::string& path) { return no_report(path, name); },
          ""));
}

void check_outputs(const BenchOptions& options) { require_writable("--json", options.json); }

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted("interrupted: nothing was measured to its end");
}

std::pair<int, int> size_named(const std::string& option, const std::string& text) {
  int width = 0, height = 0;
  char x = 0, more = 0;
  std::istringstream in(text);
  if (!(in >> width >> x >> height) || x != 'x' || in >> more || width < 1 || height < 1 ||
      width > 16384 || height > 16384)
    throw Error(fmt::format("{} {}: expected is a size such as 512x512", option, text));
  return {width, height};
}

void deliver(const Report& report, const BenchOptions& options, const Plot& plot) {
  report.print();
  if (!options.json.empty()) {
    const std::string text = report.json().dump(1) + "\n";
    write_file_atomically(options.json, Bytes(text.begin(), text.end()));
  }
  if (!options.plots.empty()) fmt::print("plot: {}\n", draw(plot, options.plots));
  if (options.compare.empty()) return;
  if (const int worse = report.compare(options.compare); worse > 0) {
    fmt::print("{} worse than in {}\n", worse, options.compare);
    throw CLI::RuntimeError(3);
  }
}

}  // namespace bench

void add_bench(CLI::App& app, const GlobalOptions& options) {
  CLI::App* bench = app.add_subcommand("bench", "Measure what gflow costs on this device");
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
