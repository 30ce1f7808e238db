// SPDX-License-Identifier: Apache-2.0
// Files of a training that another replaces. They are put aside, all or none, before the other's
// take their names, and removed after: never are some of each under their names. Where one cannot
// go they come back at once; where the program is killed in between, with the next that opens the
// run (restore_backup()).
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "optim/runs/run_folder.hpp"

namespace gflow {

class Backup {
 public:
  static constexpr const char* kName = ".former";  // of their folders: temporary_folder_name()

  // Of a run whose lock the caller has. Error when its folder cannot be written.
  explicit Backup(const RunFolder& run);
  Backup(const Backup&) = delete;
  Backup& operator=(const Backup&) = delete;
  // Puts back what is aside; removes it once given up. A warning where that fails.
  ~Backup();
  // Whether there are some of this process: it has not put all of them back.
  static bool are_aside(const RunFolder& run);

  // Files or folders of the run. Error when one cannot be moved.
  void put_aside(const std::vector<std::string>& paths);
  // The others have their names.
  void give_up() { given_up_ = true; }

 private:
  void keep_in(const std::string& folder);
  void flush() const;

  std::vector<std::string> folders_;                        // in which something is aside
  std::vector<std::pair<std::string, std::string>> moved_;  // from, to
  bool given_up_ = false;
};

// Where a training was killed while files of the former one were aside, and had not begun (its
// config.toml is among StagedFiles still), they take their names again, also those that something
// has taken meanwhile. For whoever opens a run, under its lock, which the caller has. Error when
// one of them cannot.
void restore_backup(const RunFolder& run, const FileLock&);
// The same unless another process has the lock, which is then to do so itself.
void restore_backup(const RunFolder& run);

}  // namespace gflow
