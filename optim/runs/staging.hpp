// SPDX-License-Identifier: Apache-2.0
// Staging: new files of a run are written completely before the first old one is removed. So lack
// of space or permission shows while the previous run is intact.
#pragma once
#include "optim/runs/run_folder.hpp"

namespace gflow {

class StagedFiles {
 public:
  static constexpr const char* kName = ".next";  // of the staging folder: temporary_folder_name()

  // Makes a staging folder in the run, whose lock the caller holds. Error if it cannot be made.
  // While it contains config.toml, a backup of the previous run must be restored
  // (restore_backup()); after that RunFolder::forget_unfinished_files() removes the rest.
  explicit StagedFiles(const RunFolder& run);
  StagedFiles(const StagedFiles&) = delete;
  StagedFiles& operator=(const StagedFiles&) = delete;
  ~StagedFiles();  // removes files that are still staged

  // Write the new files here.
  const RunFolder& folder() const { return folder_; }
  // Error if one of them could not take its name because something other than a file has it.
  void require_names() const;
  // Moves one file, or all that remain, to their names in the run. Error if that fails.
  void take_name(const std::string& file) const;
  void take_names() const;

 private:
  const RunFolder& run_;
  RunFolder folder_;
};

}  // namespace gflow
