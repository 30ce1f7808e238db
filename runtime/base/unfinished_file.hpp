// SPDX-License-Identifier: Apache-2.0
// Unfinished files, as a signal handler sees them: a program that ends at once removes them.
#pragma once
#include <string>

namespace gflow {

// While it exists, remove_unfinished_files() removes the file, or the folder and all in it. Does
// nothing if 64 files are registered already or the path is too long (PATH_MAX).
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

// May be called by a signal handler. The program must end afterwards.
void remove_unfinished_files();

}  // namespace gflow
