// SPDX-License-Identifier: Apache-2.0
// What an experiment file says: which trainings there are, and which line of the table each is for.
//
//   title    = "Flow supervision"
//   scenes   = ["n3v-baton", { path = "n3v-sphere", name = "sphere", flow.weight = 0.5 }]
//   seeds    = [0, 1, 2]                      # [0] where nothing is said
//   config   = "base.toml"                    # settings of every run: a file,
//   metrics  = ["psnr", "psnr_dynamic"]       # columns of the table; all there are
//   baseline = "off"                          # a row others are compared with; with several axes
//                                             # a choice of each, "*": that of the row itself
//   films    = ["cam00@9-13"]                # pictures of a test view at some steps, side by side
//   [settings]                                # and tables as in it
//   train.iterations = 3000
//   [[axis]]                                  # every combination of one choice of each axis
//   name = "flow"
//   choices = [{ name = "off", flow.weight = 0 }, { name = "DIS" }]
//   [[axis]]
//   setting = "flow.top_k"
//   values = [0, 20]
//   [[variant]]                               # or a list, which is an axis without a name
//   name = "rigid"
//   loss.rigidity = 1
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "optim/options/train_options.hpp"

namespace gflow::experiments {

// In Plan::baseline.
constexpr const char* any_choice = "*";

// A line of the table: its seeds are averaged.
struct Row {
  std::string scene;                 // its name
  std::vector<std::string> choices;  // one an axis
};

// One training.
struct PlannedRun {
  std::string id;       // of its folder: scene, choices and seed, as a file may be called
  size_t row;           // of Plan::rows
  TrainOptions config;  // whole, with scene and seed
};

// Pictures of the test views NAME_... at time steps `first` to `last` of the video, from 0.
struct Film {
  std::string view;
  size_t first = 0, last = 0;
};

struct Plan {
  std::string path, title;
  std::vector<std::string> axes;     // names; that of the list of variants is "variant"
  std::vector<Row> rows;             // scene by scene
  std::vector<PlannedRun> runs;      // row by row
  std::vector<std::string> metrics;  // empty: those there are
  // Choices of the row of each scene that the others are compared with, any_choice for that of the
  // row itself; empty: none.
  std::vector<std::string> baseline;
  std::vector<Film> films;
};

// The text as a file may be called: letters, digits and + - . _, any other byte as _.
std::string file_name(std::string text);

// The choices of a row in words; `without` where there are none.
std::string name_of(const Row& row, const std::string& without);

// Whether no run before the one of this number is of the same row.
bool is_first_seed(const Plan& plan, size_t run);

// Scenes and files are looked for from the folder of the file, then, scenes, from `scenes`. Error
// that names file and line when it cannot be read, has a key or setting that is not known, or two
// runs that are called the same.
Plan read_plan(const std::string& path, const std::string& scenes);

}  // namespace gflow::experiments
