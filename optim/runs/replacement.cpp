// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/replacement.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "optim/runs/run_names.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

namespace fs = std::filesystem;

namespace {

constexpr const char* kStaged = ".next";  // of temporary_folder_name()

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& file : fs::directory_iterator(folder, none))
    names.push_back(file.path().filename().string());
  return names;
}

std::vector<std::string> previous_files(const RunFolder& run) {
  std::vector<std::string> paths = run.training(), results = run.results();
  paths.insert(paths.end(), results.begin(), results.end());
  return paths;
}

// Error if a previous file could not be removed, or a new one could not take its name.
void require_changeable(const RunFolder& run, const std::string& staged) {
  for (const std::string& name : names_in(staged))  // folders are among the previous files
    if (!fs::is_directory(staged + "/" + name)) require_replaceable(run.path(name));
  for (const std::string& file : previous_files(run)) {
    const std::string folder = fs::path(file).parent_path().string();
    if (::access(folder.c_str(), W_OK) != 0) throw_write_error(folder, errno);
  }
}

// A folder for the new files that is removed unless it has been given its final name.
struct StagingFolder {
  explicit StagingFolder(const RunFolder& run) : path(run.path(temporary_folder_name(kStaged))) {
    std::error_code problem;
    fs::remove_all(path, problem);
    fs::create_directory(path, problem);
    if (problem) throw_write_error(path, problem.value());
  }
  ~StagingFolder() {
    std::error_code none;
    fs::remove_all(path, none);
  }
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  const std::string path;
};

void remove_previous_files(const RunFolder& run) {
  for (const std::string& file : previous_files(run)) {
    std::error_code problem;
    fs::remove_all(file, problem);
    if (problem)
      throw Error(
          fmt::format("cannot remove {} of the previous run: {}; once it can be removed, `gflow "
                      "train -o {} --resume` starts the new run",
                      file, problem.message(), run.folder()));
  }
}

void complete(const RunFolder& run) {
  const std::string begun = run.path(kRunBegun), config = begun + "/config.toml";
  // config.toml goes first, as the sign that the previous run's files are gone: a later input.ply
  // is the new run's.
  if (fs::exists(config)) {
    remove_previous_files(run);
    rename_over(config, run.path("config.toml"));
  }
  for (const std::string& name : names_in(begun)) rename_over(begun + "/" + name, run.path(name));
  std::error_code none;  // an empty folder does no harm
  fs::remove(begun, none);
}

}  // namespace

void begin_run(const RunFolder& run, const std::function<void(const RunFolder& files)>& write) {
  const StagingFolder staged(run);
  write(RunFolder(staged.path));
  require_changeable(run, staged.path);
  std::error_code problem;
  fs::rename(staged.path, run.path(kRunBegun), problem);
  if (problem) throw_write_error(run.path(kRunBegun), problem.value());
  flush_folder_of(run.path(kRunBegun));
  complete(run);
}

bool is_replacement_pending(const RunFolder& run) { return fs::exists(run.path(kRunBegun)); }

void complete_replacement(const RunFolder& run, const FileLock&) {
  if (is_replacement_pending(run)) complete(run);
}

void complete_replacement(const RunFolder& run) {
  if (!is_replacement_pending(run)) return;
  if (const auto lock = run.lock_if_free()) complete(run);
}

}  // namespace gflow
