// SPDX-License-Identifier: Apache-2.0
// The argument RUN|FILE of commands that show a model, and --iteration, which chooses one of a
// run's.
#pragma once
#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "optim/runs/run_state.hpp"

namespace gflow {

struct ModelSource {
  std::string path;  // of the file the model comes from
  HostModel model;
  std::string state;             // RunState::text; empty for a file
  std::optional<RunFolder> run;  // the folder that was named
  TrainOptions config;           // of that run
};

// Error when there is no such thing, or an iteration is chosen of what is no run.
ModelSource model_source(const std::string& run_or_file, int iteration);

// Adds --iteration, which sets `iteration`.
void add_iteration(CLI::App& command, int& iteration);
// Error where one was chosen of a path that is no run.
void require_no_iteration(int iteration, const std::string& path);
// The line that says which state was shown; none for a file.
void print_state(const std::string& state);

}  // namespace gflow
