// SPDX-License-Identifier: Apache-2.0
// Files of a training that another replaces. They are put aside, all or none, before the other's
// take their names, and removed after: the folder never holds some of each, and where one cannot
// go, or the program is killed in between, the former training is there still.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "optim/train/run_folder.hpp"

namespace gflow {

class FormerFiles {
 public:
  static constexpr const char* kName = ".former";  // of their folders: temporary_folder_name()

  // Of a run whose lock the caller has. Error when its folder cannot be written.
  explicit FormerFiles(const RunFolder& run);
  FormerFiles(const FormerFiles&) = delete;
  FormerFiles& operator=(const FormerFiles&) = delete;
  // Puts back what is aside; removes it once given up. A warning where that fails.
  ~FormerFiles();

  // Files or folders of the run. Error when one cannot be moved.
  void put_aside(const std::vector<std::string>& paths);
  // The others have their names.
  void give_up() { given_up_ = true; }

 private:
  void keep_in(const std::string& folder);

  std::vector<std::string> folders_;                        // in which something is aside
  std::vector<std::pair<std::string, std::string>> moved_;  // from, to
  bool given_up_ = false;
};

// What is to be done before a run is looked at to train it: where a process was killed while files
// were aside, and the other training had not begun (its config.toml is among NextFiles still), they
// are put back. Nothing where another process trains there.
void put_back_former_files(const RunFolder& run);

}  // namespace gflow
