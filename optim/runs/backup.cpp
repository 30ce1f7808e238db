// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/backup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "optim/runs/run_names.hpp"
#include "optim/runs/staging.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

namespace fs = std::filesystem;

namespace {

// A file's backup stays in the file's folder, which may be a link to another disk. The run's own
// folder is the last to be restored, because its backup folder names the others.
constexpr const char* kPlaces[] = {"test", "point_cloud", "checkpoints", ""};

// Names of the backup folders in a run.
std::vector<std::string> names_of_former(const RunFolder& run) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(run.folder(), none)) {
    const std::string name = entry.path().filename().string();
    if (is_temporary_name(name) && name.rfind(Backup::kName, 0) == 0) names.push_back(name);
  }
  return names;
}

// The target may be a non-empty folder that a killed run began; rename cannot replace it.
void put_back(const fs::path& file, const fs::path& to) {
  std::error_code problem;
  if (fs::is_directory(fs::symlink_status(to, problem))) fs::remove_all(to, problem);
  fs::rename(file, to, problem);
  if (problem) throw_write_error(to.string(), problem.value());
}

}  // namespace

Backup::Backup(const RunFolder& run) {
  keep_in(fs::path(run.path(kRunLock)).parent_path().string());
}

void Backup::keep_in(const std::string& folder) {
  if (std::find(folders_.begin(), folders_.end(), folder) != folders_.end()) return;
  const fs::path aside = fs::path(folder) / temporary_folder_name(Backup::kName);
  std::error_code problem;
  fs::create_directory(aside, problem);  // may exist: two places may link to one folder
  if (problem) throw_write_error(aside.string(), problem.value());
  flush_folder_of(aside.string());
  folders_.push_back(folder);
}

void Backup::put_aside(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    const fs::path from(path);
    keep_in(from.parent_path().string());
    const fs::path to = from.parent_path() / temporary_folder_name(Backup::kName) / from.filename();
    std::error_code problem;
    fs::rename(from, to, problem);
    if (problem) throw_write_error(path, problem.value());
    moved_.emplace_back(path, to.string());
  }
  flush();
}

// Flushes before other files take the names, also on other disks behind links.
void Backup::flush() const {
  for (const std::string& folder : folders_) {
    const fs::path aside = fs::path(folder) / temporary_folder_name(kName);
    flush_folder_of(aside / "");
    flush_folder_of(aside);
  }
}

bool Backup::are_aside(const RunFolder& run) {
  std::error_code none;
  return fs::exists(run.path(temporary_folder_name(kName)), none);
}

Backup::~Backup() {
  std::error_code problem;
  std::string why;
  int left = 0;
  if (!given_up_)
    for (auto file = moved_.rbegin(); file != moved_.rend(); ++file) {
      fs::rename(file->second, file->first, problem);
      if (problem && ++left == 1) why = file->first + ": " + problem.message();
    }
  if (left > 0) {
    warn(
        fmt::format("cannot put back {}{}; the next gflow that opens that folder does so, once it "
                    "can be written",
                    why, left > 1 ? fmt::format(", nor {} more", left - 1) : ""));
    return;
  }
  for (const std::string& folder : folders_) {
    const fs::path aside = fs::path(folder) / temporary_folder_name(kName);
    fs::remove_all(aside, problem);
    if (problem)
      warn(fmt::format("{} of the former training stays: {}", aside.string(), problem.message()));
  }
}

void restore_backup(const RunFolder& run, const FileLock&) {
  for (const std::string& name : names_of_former(run)) {
    const std::string next = StagedFiles::kName + name.substr(std::string(Backup::kName).size());
    if (!fs::exists(run.path(next + "/config.toml"))) continue;
    for (const char* place : kPlaces) {
      const fs::path folder = fs::path(run.folder()) / place;
      std::vector<fs::path> files;
      std::error_code none;
      for (const auto& file : fs::directory_iterator(folder / name, none))
        files.push_back(file.path());
      for (const fs::path& file : files) put_back(file, folder / file.filename());
      fs::remove(folder / name, none);
    }
    fs::remove_all(run.path(next));
  }
}

void restore_backup(const RunFolder& run) {
  if (names_of_former(run).empty()) return;
  if (const auto lock = run.lock_if_free()) restore_backup(run, *lock);
}

}  // namespace gflow
