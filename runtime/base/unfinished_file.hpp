// SPDX-License-Identifier: Apache-2.0
// Temporaries as a signal handler sees them: a program that ends at once removes what it had begun
// to write.
#pragma once
#include <string>

namespace gflow {

// While one of these lives, remove_unfinished_files() removes the file, or folder with all that is
// in it. Where more files are
// written at once than there is room to note (64), or the path is longer than a path can be, the
// file is not noted.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

// May be called by a signal handler; the program must end after it.
void remove_unfinished_files();

}  // namespace gflow
