// SPDX-License-Identifier: Apache-2.0
// An experiment file: the trainings and the table row of each.
//
//   title    = "Flow supervision"
//   scenes   = ["n3v-baton", { path = "n3v-sphere", name = "sphere", flow.weight = 0.5 }]
//   seeds    = [0, 1, 2]                      # default: [0]
//   config   = "base.toml"                    # settings of every run, from a file
//   metrics  = ["psnr", "psnr_dynamic"]       # columns of the table; default: all available
//   baseline = "off"                          # row to compare with; with several axes one
//                                             # choice per axis, "*": that of the row itself
//   films    = ["cam00@9-13"]                 # images of a test view at some steps, side by side
//   [settings]                                # settings of every run, as in a configuration file
//   train.iterations = 3000
//   [[axis]]                                  # runs all combinations of one choice per axis
//   name = "flow"
//   choices = [{ name = "off", flow.weight = 0 }, { name = "DIS" }]
//   [[axis]]
//   setting = "flow.top_k"
//   values = [0, 20]
//   [[variant]]                               # a list of variants is an axis without a name
//   name = "rigid"
//   loss.rigidity = 1
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "optim/options/train_options.hpp"

namespace gflow::experiments {

// Wildcard in Plan::baseline.
constexpr const char* any_choice = "*";

// A row of the table: the mean over its seeds.
struct Row {
  std::string scene;                 // its name
  std::vector<std::string> choices;  // one per axis
};

// One training.
struct PlannedRun {
  std::string id;       // name of its folder: scene, choices and seed, as a valid file name
  size_t row;           // index into Plan::rows
  TrainOptions config;  // complete settings, with scene and seed
};

// Images of the test views NAME_... at time steps `first` to `last` of the video, from 0.
struct Film {
  std::string view;
  size_t first = 0, last = 0;
};

struct Plan {
  std::string path, title;
  std::vector<std::string> axes;     // names; that of the list of variants is "variant"
  std::vector<Row> rows;             // scene by scene
  std::vector<PlannedRun> runs;      // row by row
  std::vector<std::string> metrics;  // empty: all available
  // For each axis the choice of the row that others are compared with; any_choice: that of the row
  // itself. Empty: no baseline.
  std::vector<std::string> baseline;
  std::vector<Film> films;
};

// The text as a file name: letters, digits and + - . _ are kept, any other byte becomes _.
std::string file_name(std::string text);

// The choices of a row as text; `without` if it has none.
std::string name_of(const Row& row, const std::string& without);

// Whether this is the first run of its row.
bool is_first_seed(const Plan& plan, size_t run);

// Looks for scenes and files relative to the experiment file, then for scenes in `scenes`. Throws
// an Error with file and line if the file cannot be read, contains an unknown key or setting, or
// gives two runs the same name.
Plan read_plan(const std::string& path, const std::string& scenes);

}  // namespace gflow::experiments
