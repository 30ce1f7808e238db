// SPDX-License-Identifier: Apache-2.0
// A folder for what a bench computes on the way, gone at the end.
#pragma once
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "runtime/error.hpp"

namespace gflow::bench {

class ScratchFolder {
 public:
  // Error when the system's folder for temporary files takes none.
  ScratchFolder() {
    path_ = (std::filesystem::temp_directory_path() / "gflow-bench-XXXXXX").string();
    if (!mkdtemp(path_.data())) throw Error(fmt::format("cannot make a folder {}", path_));
  }
  ~ScratchFolder() {
    std::error_code problem;
    std::filesystem::remove_all(path_, problem);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::string file(const char* name) const {
    return (std::filesystem::path(path_) / name).string();
  }

 private:
  std::string path_;
};

}  // namespace gflow::bench
