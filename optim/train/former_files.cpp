// SPDX-License-Identifier: Apache-2.0
#include "optim/train/former_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "optim/io/atomic_file.hpp"
#include "optim/io/run_names.hpp"
#include "optim/io/warning.hpp"
#include "optim/train/next_files.hpp"

namespace gflow {

namespace fs = std::filesystem;

namespace {

// What is put aside stays in the folder it lies in, which may be a link to another disk.
constexpr const char* kPlaces[] = {"", "checkpoints", "point_cloud"};

}  // namespace

FormerFiles::FormerFiles(const RunFolder& run) {
  keep_in(fs::path(run.path(kRunLock)).parent_path().string());
}

void FormerFiles::keep_in(const std::string& folder) {
  if (std::find(folders_.begin(), folders_.end(), folder) != folders_.end()) return;
  const fs::path aside = fs::path(folder) / temporary_folder_name(FormerFiles::kName);
  std::error_code problem;
  fs::create_directory(aside, problem);  // or it is there: two places may be links to one
  if (problem) refuse_to_write(aside.string(), problem.value());
  folders_.push_back(folder);
}

void FormerFiles::put_aside(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    const fs::path from(path);
    keep_in(from.parent_path().string());
    const fs::path to =
        from.parent_path() / temporary_folder_name(FormerFiles::kName) / from.filename();
    std::error_code problem;
    fs::rename(from, to, problem);
    if (problem) refuse_to_write(path, problem.value());
    moved_.emplace_back(path, to.string());
  }
}

FormerFiles::~FormerFiles() {
  std::error_code problem;
  std::string not_back;
  if (!given_up_)
    for (auto file = moved_.rbegin(); file != moved_.rend(); ++file) {
      fs::rename(file->second, file->first, problem);
      if (problem) not_back = file->first + ": " + problem.message();
    }
  if (!not_back.empty()) {
    warn(fmt::format("cannot put back {}; the next `gflow train` into that folder does so",
                     not_back));
    return;
  }
  for (const std::string& folder : folders_) {
    const fs::path aside = fs::path(folder) / temporary_folder_name(kName);
    fs::remove_all(aside, problem);
    if (problem)
      warn(fmt::format("{} of the former training stays: {}", aside.string(), problem.message()));
  }
}

void put_back_former_files(const RunFolder& run) {
  std::vector<std::string> former;  // names of their folders
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(run.folder(), none)) {
    const std::string name = entry.path().filename().string();
    if (is_temporary_name(name) && name.rfind(FormerFiles::kName, 0) == 0) former.push_back(name);
  }
  if (former.empty()) return;
  const auto lock = run.lock_if_free();
  if (!lock) return;
  for (const std::string& name : former) {
    const std::string next = NextFiles::kName + name.substr(std::string(FormerFiles::kName).size());
    if (!fs::exists(run.path(next + "/config.toml"))) continue;
    for (const char* place : kPlaces) {
      const fs::path folder = fs::path(run.folder()) / place;
      std::vector<fs::path> files;
      for (const auto& file : fs::directory_iterator(folder / name, none))
        files.push_back(file.path());
      for (const fs::path& file : files) {
        std::error_code problem;
        fs::rename(file, folder / file.filename(), problem);
        if (problem) refuse_to_write((folder / file.filename()).string(), problem.value());
      }
    }
  }
}

}  // namespace gflow
