// SPDX-License-Identifier: Apache-2.0
// The argument RUN|FILE of commands that show a model, and the option --iteration, which selects a
// model of a run.
#pragma once
#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "optim/runs/run_state.hpp"

namespace gflow {

struct ModelSource {
  std::string path;  // file that the model is read from
  HostModel model;
  std::string state;             // RunState::text; empty for a file
  std::optional<RunFolder> run;  // the run folder, if one was given
  TrainOptions config;           // of that run
};

// Throws an Error if nothing is there, or if an iteration is selected without a run.
ModelSource model_source(const std::string& run_or_file, int iteration, Undrawable undrawable);

// Adds --iteration, which sets `iteration`.
void add_iteration(CLI::App& command, int& iteration);
// Throws an Error if an iteration was selected but the path is not a run.
void require_no_iteration(int iteration, const std::string& path);
// Prints which state of the run was used; nothing for a file.
void print_state(const std::string& state);

}  // namespace gflow
