// SPDX-License-Identifier: Apache-2.0
// One process at a time: a lock that ends with the process that holds it, however it ends.
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
  // Locks the file, which is made where it is missing and stays behind: what counts is the lock of
  // the system, not that the file is there. FileIsLocked, with the number of the process, when
  // another one has it; `what` is the folder or file it stands for. On a file system without locks
  // nothing is locked, and a warning says so.
  FileLock(const std::string& path, const std::string& what);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int file_;
};

// The same of a folder that is there, with nothing left behind; FileIsLocked does not say who.
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
