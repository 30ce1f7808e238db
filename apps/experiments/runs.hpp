// SPDX-License-Identifier: Apache-2.0
// The trainings of an experiment: FOLDER/runs/ID is a run folder of `gflow train`, ID.toml its
// settings, ID.log its output.
#pragma once
#include <string>
#include <vector>

#include "apps/experiments/plan.hpp"

namespace gflow::experiments {

struct RunFiles {
  RunFiles(const std::string& folder, const std::string& id)
      : run(folder + "/runs/" + id), settings(run + ".toml"), log(run + ".log") {}
  std::string run, settings, log;
};

// Throws an Error if the folder contains files that tables and images would overwrite, but no
// training settings, which an experiment writes first: then the files are not those of an
// experiment.
void require_no_other_tables(const std::string& folder);

enum class Status { missing, stopped, finished, other_settings };

struct Standing {
  Status status = Status::missing;
  int steps = 0;           // finished steps
  double seconds = 0;      // training time of these steps; NaN if unknown
  std::string difference;  // other_settings: the first different setting and its values
};

Standing standing_of(const PlannedRun& run, const std::string& folder);

// Estimated time left of each run, from the measured steps, of the same scene if possible. Without
// any, from the image size: `guessed`.
struct TimeLeft {
  std::vector<double> left;  // NaN: unknown
  bool guessed = false;
};
TimeLeft time_left(const Plan& plan, const std::vector<Standing>& standings);

struct RunOptions {
  int jobs = 1;                      // parallel trainings
  std::vector<std::string> devices;  // used in turn; empty: the default device
  bool quiet = false;
  bool redo = false;           // restarts runs with other settings
  bool allow_command = false;  // allows programs that guidance.command names
};

// Some runs failed.
struct RunsFailed : Error {
  using Error::Error;
};

// Trains the missing runs in child processes. A failed run is reported and the others continue;
// RunsFailed at the end names it. Waits for runs that another process trains. Throws an Error first
// if a run has other settings and `redo` is off. On a signal all trainings stop and save:
// Interrupted.
void train_all(const Plan& plan, const std::string& folder, const RunOptions& options);

}  // namespace gflow::experiments
