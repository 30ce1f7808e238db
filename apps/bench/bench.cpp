// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/bench.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "apps/command_line.hpp"
#include "optim/io/atomic_file.hpp"

namespace gflow {
namespace bench {

void add_common(CLI::App& bench, BenchOptions& options) {
  bench.add_option("--repeats", options.repeats, "Measured runs; medians are told")
      ->check(number_in(1, 1000));
  bench.add_option("--json", options.json, "Write what was measured here")->type_name("FILE");
  bench
      .add_option("--compare", options.compare,
                  "Show ratios to an earlier --json FILE; those above 1.1 are marked and make the "
                  "exit code 3")
      ->type_name("FILE");
}

void deliver(const Report& report, const BenchOptions& options) {
  report.print();
  if (!options.json.empty()) {
    const std::string text = report.json().dump(1) + "\n";
    write_file_atomically(options.json, Bytes(text.begin(), text.end()));
  }
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
#ifdef GFLOW_WITH_OPENCV
  bench::add_step(*bench, options);
#endif
}

}  // namespace gflow
