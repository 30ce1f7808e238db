// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/staging.hpp"

#include <filesystem>

#include "optim/runs/backup.hpp"
#include "optim/runs/run_names.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

namespace fs = std::filesystem;

StagedFiles::StagedFiles(const RunFolder& run)
    : run_(run), folder_(run.path(temporary_folder_name(kName))) {
  std::error_code problem;
  fs::remove_all(folder_.folder(), problem);
  fs::create_directory(folder_.folder(), problem);
  if (problem) throw_write_error(folder_.folder(), problem.value());
  flush_folder_of(folder_.folder());
}

StagedFiles::~StagedFiles() {
  if (Backup::are_aside(run_)) return;  // restore_backup() needs the folder
  std::error_code none;
  fs::remove_all(folder_.folder(), none);
}

void StagedFiles::require_names() const {
  for (const auto& file : fs::directory_iterator(folder_.folder()))
    require_replaceable(run_.path(file.path().filename().string()));
}

void StagedFiles::take_name(const std::string& file) const {
  rename_over(folder_.path(file), run_.path(file));
}

void StagedFiles::take_names() const {
  std::vector<std::string> files;
  for (const auto& file : fs::directory_iterator(folder_.folder()))
    files.push_back(file.path().filename().string());
  for (const std::string& file : files) take_name(file);
}

}  // namespace gflow
