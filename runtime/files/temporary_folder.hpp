// SPDX-License-Identifier: Apache-2.0
// Temporary folders.
#pragma once
#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/base/unfinished_file.hpp"

namespace gflow {

// No temporary folder can be made: neither the device nor the task is at fault.
struct NoTemporaryFolder : Error {
  using Error::Error;
};

// Makes a new folder whose name contains its purpose. The caller removes it.
inline std::string make_temporary_folder(const std::string& purpose) {
  std::string parent = "/tmp", named;
  for (const char* variable : {"TMPDIR", "TMP", "TEMP", "TEMPDIR"})  // as the standard library does
    if (const char* value = std::getenv(variable); value && *value && named.empty()) {
      parent = value;
      named = fmt::format(" (from {})", variable);
    }
  std::string path = fmt::format("{}/gflow-{}-XXXXXX", parent, purpose);
  if (!mkdtemp(path.data()))
    throw NoTemporaryFolder(
        fmt::format("cannot create a temporary folder in {}{}: {}; set TMPDIR to a writable folder",
                    parent, named, std::strerror(errno)));
  return path;
}

// A temporary folder, removed with its contents by the destructor or remove_unfinished_files().
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& purpose)
      : path_(make_temporary_folder(purpose)), noted_(path_) {}
  ~ScratchFolder() {
    std::error_code problem;
    std::filesystem::remove_all(path_, problem);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& path() const { return path_; }
  // Path of a file in the folder; creates its parent folders.
  std::string file(const std::string& name) const {
    const std::filesystem::path full = std::filesystem::path(path_) / name;
    std::filesystem::create_directories(full.parent_path());
    return full.string();
  }

 private:
  std::string path_;
  UnfinishedFile noted_;
};

}  // namespace gflow
