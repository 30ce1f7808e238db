// SPDX-License-Identifier: Apache-2.0
// Backup of the previous run's files while a new run replaces them. All of them are moved aside, or
// none, before the new files take their names, and are removed afterwards. So the folder never
// holds a mixture. If one cannot be moved, all are moved back at once; if the process is killed in
// between, the next one that opens the run does so (restore_backup()).
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "optim/runs/run_folder.hpp"

namespace gflow {

class Backup {
 public:
  static constexpr const char* kName = ".former";  // of the backup folders: temporary_folder_name()

  // For a run whose lock the caller holds. Error if its folder cannot be written.
  explicit Backup(const RunFolder& run);
  Backup(const Backup&) = delete;
  Backup& operator=(const Backup&) = delete;
  // Moves the files back, or removes them after give_up(). Warns if that fails.
  ~Backup();
  // Whether a backup of this process exists: not all of its files are back.
  static bool are_aside(const RunFolder& run);

  // Moves files or folders of the run aside. Error if one cannot be moved.
  void put_aside(const std::vector<std::string>& paths);
  // The new files have taken their names: the backup is no longer needed.
  void give_up() { given_up_ = true; }

 private:
  void keep_in(const std::string& folder);
  void flush() const;

  std::vector<std::string> folders_;                        // folders that contain a backup folder
  std::vector<std::pair<std::string, std::string>> moved_;  // from, to
  bool given_up_ = false;
};

// Undoes an unfinished replacement. If a process was killed while the previous run's files were in
// a backup and before the new run began (its config.toml is still staged), they get their names
// back and replace what has taken these meanwhile. Call it on opening a run, with its lock held.
// Error if a file cannot be moved.
void restore_backup(const RunFolder& run, const FileLock&);
// The same; does nothing if another process holds the lock, because that process will do it.
void restore_backup(const RunFolder& run);

}  // namespace gflow
