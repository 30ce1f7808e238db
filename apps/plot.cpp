// SPDX-License-Identifier: Apache-2.0
#include "apps/plot.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>
#include <filesystem>

#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

namespace gflow {

std::string draw(const Plot& plot, const std::string& folder) {
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
  setenv("GFLOW_PLOTS", folder.c_str(), 1);  // not read by the shell, whatever it holds
  const std::string command =
      fmt::format("cd -- \"$GFLOW_PLOTS\" && gnuplot {}.gnuplot 2> /dev/null", plot.name);
  if (std::system(command.c_str()) == 0)
    return (std::filesystem::path(folder) / (plot.name + ".svg")).string();
  return fmt::format("run `gnuplot {}.gnuplot` in {} (gnuplot, Debian's gnuplot-nox, could not)",
                     plot.name, folder);
}

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

}  // namespace gflow
