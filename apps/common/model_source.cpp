// SPDX-License-Identifier: Apache-2.0
#include "apps/common/model_source.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "apps/common/command_line.hpp"
#include "runtime/base/output.hpp"

namespace gflow {

ModelSource model_source(const std::string& run_or_file, int iteration, Undrawable undrawable) {
  if (!std::filesystem::exists(run_or_file))
    throw Error(
        fmt::format("cannot read {}: there is no such run folder or splat file", run_or_file));
  if (!std::filesystem::is_directory(run_or_file)) {
    require_no_iteration(iteration, run_or_file);
    return {run_or_file, read_model(run_or_file, undrawable), "", std::nullopt, {}};
  }
  const RunFolder run = RunFolder::open(run_or_file);
  RunState state = read_run_state(run, iteration);
  return {state.path, std::move(state.model), state.text(), run, std::move(state.config)};
}

void add_iteration(CLI::App& command, int& iteration) {
  command
      .add_option("--iteration", iteration,
                  "Iteration of a run that has a point_cloud/iteration_N or a checkpoint; default: "
                  "the latest")
      ->type_name("N")
      ->default_str("")
      ->check(number_in(0, 2147483647));
}

void require_no_iteration(int iteration, const std::string& path) {
  if (iteration != latest_iteration)
    throw Error(fmt::format(
        "--iteration {} selects an iteration of a run folder, but {} is not one", iteration, path));
}

void print_state(const std::string& state) {
  if (!state.empty()) print_result("model     {}\n", state);
}

}  // namespace gflow
