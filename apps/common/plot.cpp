// SPDX-License-Identifier: Apache-2.0
#include "apps/common/plot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

namespace {

struct NotDrawn : Error {  // gnuplot is missing or failed
  using Error::Error;
};

// Checks the end that gnuplot writes last: it does not report a full disk.
void require_whole(const std::string& image, std::string_view end, const std::string& path) {
  const Bytes bytes = read_file(image);
  std::string text(bytes.begin(), bytes.end());
  while (!text.empty() && text.back() == '\n') text.pop_back();
  if (text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0)
    return;
  require_room(image, path);
  throw Error(fmt::format("cannot write {}: gnuplot left it incomplete", path));
}

std::string name_of_file(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// Runs the script in `folder` and writes these two files there. gnuplot is killed when this process
// ends in any way: otherwise it would recreate files that were just removed.
void run_gnuplot(const std::string& script, const std::string& folder, const std::string& svg,
                 const std::string& png) {
  const std::string names = fmt::format("svg='{}'; png='{}'", name_of_file(svg), name_of_file(png));
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) {  // after fork: no allocation, no locks
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == parent &&
        ::chdir(folder.c_str()) == 0 && ::dup2(nowhere, STDERR_FILENO) >= 0)
      ::execlp("gnuplot", "gnuplot", "-e", names.c_str(), script.c_str(), nullptr);
    ::_exit(127);
  }
  int status = -1;
  while (child > 0 && ::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0) throw NotDrawn("gnuplot could not");
}

// Colours that stay distinct in a stack: gnuplot has eight and then repeats them.
std::string twelve_colors() {
  std::string script;
  int number = 0;
  for (const char* color : {"4477aa", "ee6677", "228833", "ccbb44", "66ccee", "aa3377", "bbbbbb",
                            "332288", "ee8866", "44bb99", "882255", "ffaabb"})
    script += fmt::format("set linetype {} lc rgb '#{}'\n", ++number, color);
  return script;
}

}  // namespace

std::string draw(const Plot& plot, const std::string& folder) {
  std::error_code problem;
  std::filesystem::create_directories(folder, problem);
  if (problem)
    throw Error(
        fmt::format("plotting into {}: cannot create the folder: {}", folder, problem.message()));
  const auto path = [&](const char* ending) {
    return (std::filesystem::path(folder) / (plot.name + ending)).string();
  };
  std::string data;
  for (const std::vector<std::string>& line : plot.table)
    data += fmt::format("{}\n", fmt::join(line, "\t"));
  write_file_atomically(path(".tsv"), std::string_view(data));
  std::string script = "set datafile separator tab\nset grid\nset key outside right\n";
  for (const auto& [terminal, ending] : {std::pair{"svg", "svg"}, {"pngcairo", "png"}}) {
    script += fmt::format("if (!exists('{0}')) {0} = '{1}.{0}'\n", ending, plot.name);
    script += fmt::format("set terminal {} size {},{} background rgb 'white'\n", terminal,
                          plot.width, plot.height);
    script += fmt::format("set output {}\n{}\n", ending, plot.script);
  }
  write_file_atomically(path(".gnuplot"), std::string_view(script));
  try {
    replace_file(path(".svg"), [&](const std::string& svg) {
      replace_file(path(".png"), [&](const std::string& png) {
        run_gnuplot(plot.name + ".gnuplot", folder, svg, png);
        require_whole(svg, "</svg>", path(".svg"));
        require_whole(png, "IEND\xae\x42\x60\x82", path(".png"));
      });
    });
  } catch (const NotDrawn&) {
    return fmt::format(
        "run `gnuplot {}.gnuplot` in {} (gnuplot is not installed or failed; Debian package: "
        "gnuplot-nox)",
        plot.name, folder);
  }
  return path(".svg");
}

Plot bars(const std::string& name, const std::string& what,
          std::vector<std::vector<std::string>> table) {
  Plot plot;
  plot.name = name;
  plot.script = fmt::format(
      "set termoption noenhanced\nset style data histograms\nset style histogram rowstacked\n"
      "set style fill solid 0.8\nset boxwidth 0.7\nset yrange [0:*]\nset ylabel '{}'\n"
      "set xtics rotate by -25\nset rmargin 30\n{}"
      "plot for [i=2:{}] '{}.tsv' using i:xtic(1) lt (i-1) title columnheader(i)",
      what, twelve_colors(), table[0].size(), name);
  plot.table = std::move(table);
  return plot;
}

}  // namespace gflow
