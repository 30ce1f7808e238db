// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/bench.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "apps/command_line.hpp"
#include "optim/io/atomic_file.hpp"

namespace gflow {
namespace bench {

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
      ->type_name("FILE");
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

namespace {

void draw(const Plot& plot, const std::string& folder) {
  std::error_code problem;
  std::filesystem::create_directories(folder, problem);
  if (problem)
    throw Error(
        fmt::format("drawing into {}: cannot make that folder: {}", folder, problem.message()));
  const auto write = [&](const std::string& ending, const std::string& text) {
    write_file_atomically((std::filesystem::path(folder) / (plot.name + ending)).string(),
                          Bytes(text.begin(), text.end()));
  };
  std::string data;
  for (const std::vector<std::string>& line : plot.table)
    data += fmt::format("{}\n", fmt::join(line, "\t"));
  write(".tsv", data);
  std::string script = "set datafile separator tab\nset grid\nset key outside right\n";
  for (const auto& [terminal, ending] : {std::pair{"svg", "svg"}, {"pngcairo", "png"}}) {
    script += fmt::format("set terminal {} size {},{} background rgb 'white'\n", terminal,
                          plot.width, plot.height);
    script += fmt::format("set output '{}.{}'\n{}\n", plot.name, ending, plot.script);
  }
  write(".gnuplot", script);
  setenv("GFLOW_BENCH_PLOTS", folder.c_str(), 1);  // not read by the shell, whatever it holds
  const std::string command =
      fmt::format("cd -- \"$GFLOW_BENCH_PLOTS\" && gnuplot {}.gnuplot 2> /dev/null", plot.name);
  if (std::system(command.c_str()) == 0)
    fmt::print("plot: {}\n", (std::filesystem::path(folder) / (plot.name + ".svg")).string());
  else
    fmt::print("plot: run `gnuplot {}.gnuplot` in {} (gnuplot, Debian's gnuplot-nox, could not)\n",
               plot.name, folder);
}

}  // namespace

Plot bars(const std::string& name, const std::string& what,
          std::vector<std::vector<std::string>> table) {
  Plot plot;
  plot.name = name;
  plot.script = fmt::format(
      "set termoption noenhanced\nset style data histograms\nset style histogram rowstacked\n"
      "set style fill solid 0.8\nset boxwidth 0.7\nset yrange [0:*]\nset ylabel '{}'\n"
      "set xtics rotate by -25\nplot for [i=2:{}] '{}.tsv' using i:xtic(1) title columnheader(i)",
      what, table[0].size(), name);
  plot.table = std::move(table);
  return plot;
}

void deliver(const Report& report, const BenchOptions& options, const Plot& plot) {
  report.print();
  if (!options.json.empty()) {
    const std::string text = report.json().dump(1) + "\n";
    write_file_atomically(options.json, Bytes(text.begin(), text.end()));
  }
  if (!options.plots.empty()) draw(plot, options.plots);
  if (options.compare.empty()) return;
  if (const int slower = report.compare(options.compare); slower > 0) {
    fmt::print("{} slower than in {}\n", slower, options.compare);
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
