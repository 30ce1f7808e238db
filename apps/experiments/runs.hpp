// SPDX-License-Identifier: Apache-2.0
// The trainings of an experiment: FOLDER/runs/ID is a run folder as `gflow train` makes it, ID.toml
// its settings, ID.log what it said.
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

// Error where the folder has files that tables and pictures would be written over, and no settings
// of a training, which an experiment writes before them: they are somebody else's.
void require_no_other_tables(const std::string& folder);

enum class Status { missing, stopped, finished, other_settings };

struct Standing {
  Status status = Status::missing;
  int steps = 0;           // made
  double seconds = 0;      // they took; NaN where nothing says
  std::string difference;  // other_settings: the first setting that is another, and its values
};

Standing standing_of(const PlannedRun& run, const std::string& folder);

// Likely seconds that are left of each run, from the steps that were made, of the same scene where
// there are any. Where there are none at all, by the size of the pictures: `guessed`.
struct TimeLeft {
  std::vector<double> left;  // NaN: not known
  bool guessed = false;
};
TimeLeft time_left(const Plan& plan, const std::vector<Standing>& standings);

struct RunOptions {
  int jobs = 1;                      // trainings at a time
  std::vector<std::string> devices;  // which they take in turn; empty: the default one
  bool quiet = false;
  bool redo = false;           // runs with other settings are begun anew
  bool allow_command = false;  // programs that guidance.command names are started
};

// Some runs did not come to their end.
struct RunsFailed : Error {
  using Error::Error;
};

// Trains what is missing, as other processes. A run that fails is told and the others go on;
// RunsFailed at the end names it. What another process is training already is waited for. Error
// before anything is done when there is a run with other settings and not redo. On a signal all are
// stopped, which saves them: Interrupted.
void train_all(const Plan& plan, const std::string& folder, const RunOptions& options);

}  // namespace gflow::experiments
