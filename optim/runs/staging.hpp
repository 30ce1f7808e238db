// SPDX-License-Identifier: Apache-2.0
// Files of a run that are written before the first of those they replace goes: that there is room
// for them, and leave to write them, is known while the former run is whole.
#pragma once
#include "optim/runs/run_folder.hpp"

namespace gflow {

class StagedFiles {
 public:
  static constexpr const char* kName = ".next";  // of their folder: temporary_folder_name()

  // A folder within the run's, whose lock the caller has. Error when it cannot be made. While its
  // config.toml is there files of the former training that are aside are to come back
  // (restore_backup()); after that what a killed process leaves of it goes with
  // RunFolder::forget_unfinished_files().
  explicit StagedFiles(const RunFolder& run);
  StagedFiles(const StagedFiles&) = delete;
  StagedFiles& operator=(const StagedFiles&) = delete;
  ~StagedFiles();  // removes what has not taken its name

  // Where they are to be written.
  const RunFolder& folder() const { return folder_; }
  // Error when one of them could not take its name in the run: something that is no file has it.
  void require_names() const;
  // Moves one, or each that is left, to its name in the run. Error when it cannot be.
  void take_name(const std::string& file) const;
  void take_names() const;

 private:
  const RunFolder& run_;
  RunFolder folder_;
};

}  // namespace gflow
