// SPDX-License-Identifier: Apache-2.0
// Locks for one process at a time. A lock ends with the process that holds it, however it ends.
#pragma once
#include <string>

#include "runtime/base/error.hpp"

namespace gflow {

// Another process, or another FileLock of this one, has the lock.
struct FileIsLocked : Error {
  using Error::Error;
};

class FileLock {
 public:
  // Locks the file and makes it if it is missing. It stays behind: the system's lock counts, not
  // the file. FileIsLocked, with the number of the process, if someone else has the lock; `what` is
  // the folder or file it stands for. On a file system without locks, only warns.
  FileLock(const std::string& path, const std::string& what);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int file_;
};

// The same for an existing folder, leaving nothing behind. FileIsLocked does not name the holder.
class FolderLock {
 public:
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int folder_;
};

}  // namespace gflow
