// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "optim/runs/replacement.hpp"
#include "optim/runs/run_names.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// Whether a folder contains more than a lock and temporary files, which a training killed at its
// start leaves.
bool holds_something(const std::string& folder) {
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    const std::string name = entry.path().filename().string();
    if (name != kRunLock && !is_temporary_name(name)) return true;
  }
  return false;
}

// Sets `config` to the settings of the last readable checkpoint and returns its path; leaves it
// unchanged and returns "" if there is none.
std::string last_settings(const CheckpointFolder& checkpoints, TrainOptions& config) {
  for (const int step : checkpoints.steps()) {
    const std::string path = checkpoints.path(step);
    try {
      TrainOptions kept;
      apply_text(kept, read_checkpoint_facts(path).config, "the settings in " + path);
      check(kept);
      config = kept;
      return path;
    } catch (const Error&) {  // reported when the checkpoint itself is read
    }
  }
  return "";
}

std::vector<std::string> those_there(std::vector<std::string> paths) {
  const auto is_missing = [](const std::string& path) {
    std::error_code none;
    return !fs::exists(fs::symlink_status(path, none));
  };
  paths.erase(std::remove_if(paths.begin(), paths.end(), is_missing), paths.end());
  return paths;
}

}  // namespace

void RunFolder::make() const {
  if (folder_.empty()) throw Error("the name of the run folder is empty: set it with -o FOLDER");
  std::error_code problem;
  // Only run folders may be replaced; other folders are not ours.
  if (holds_something(folder_) && !is_made_by_training(folder_))
    throw Error(
        fmt::format("training into {}: it is not empty and not a run folder; name a new folder, or "
                    "a previous run to replace",
                    folder_));
  if (fs::is_symlink(folder_, problem) && !fs::exists(folder_, problem))
    throw Error(
        fmt::format("creating run folder {}: it is a link to {}, which does not exist; create that "
                    "folder, or name another",
                    folder_, fs::read_symlink(folder_).string()));
  if (fs::exists(folder_, problem) && !fs::is_directory(folder_, problem))
    throw Error(
        fmt::format("training into {}: it is a file, but -o needs a folder; name a new folder, or "
                    "a previous run to replace",
                    folder_));
  fs::create_directories(folder_, problem);
  if (problem) throw Error(fmt::format("creating run folder {}: {}", folder_, problem.message()));
}

RunFolder RunFolder::create(const std::string& path) {
  const RunFolder run(path);
  run.make();
  return run;
}

FileLock RunFolder::lock() const { return FileLock(path(kRunLock), folder_); }

std::unique_ptr<FileLock> RunFolder::lock_if_free() const {
  try {
    return std::make_unique<FileLock>(path(kRunLock), folder_);
  } catch (const FileIsLocked&) {
    return nullptr;
  }
}

bool RunFolder::is_run(const std::string& path) {
  const RunFolder run(path);
  return fs::exists(run.path("config.toml")) || is_replacement_pending(run) ||
         !run.checkpoints().steps().empty();
}

void RunFolder::require_no_pending_replacement(const std::string& path) {
  const RunFolder run(path);
  if (!is_run(path) && fs::exists(run.path(kRunLock))) run.lock();
}

RunFolder RunFolder::open(const std::string& path) {
  require_no_pending_replacement(path);
  if (!is_run(path))
    throw Error(fmt::format(
        "{} is not a run folder: it has no config.toml, which `gflow train -o {}` writes", path,
        path));
  const RunFolder run(path);
  try {
    complete_replacement(run);
  } catch (const Error& problem) {
    warn(problem.what());
  }
  return run;
}

std::string RunFolder::model_path(int iteration) const {
  return path(fmt::format("point_cloud/iteration_{}/point_cloud.ply", iteration));
}

std::vector<int> RunFolder::models() const {
  std::vector<int> iterations;
  std::error_code none;  // a training process may remove the folder meanwhile
  for (const auto& entry : fs::directory_iterator(path("point_cloud"), none)) {
    const int iteration = iteration_of_name(entry.path().filename().string());
    if (iteration >= 0 && fs::exists(entry.path() / "point_cloud.ply"))
      iterations.push_back(iteration);
  }
  std::sort(iterations.rbegin(), iterations.rend());
  return iterations;
}

void RunFolder::write_model(int iteration, const HostModel& model) const {
  const std::string folder = fs::path(model_path(iteration)).parent_path().string();
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem) throw Error(fmt::format("cannot create {}: {}", folder, problem.message()));
  flush_folder_of(folder);
  gflow::write_model(model_path(iteration), model);
}

void RunFolder::remove_model(int iteration) const {
  fs::remove_all(fs::path(model_path(iteration)).parent_path());
}

void RunFolder::require_its_folders() const {
  for (const char* name : {"checkpoints", "point_cloud", "flow", "frames", "moving", "test"}) {
    const std::string folder = path(name);
    std::error_code problem, none;
    fs::directory_iterator(folder, problem);
    if (!problem || !fs::exists(fs::symlink_status(folder, none))) continue;
    if (fs::is_symlink(folder, none) && !fs::exists(folder, none))
      throw Error(
          fmt::format("training into {}: {} is a link to {}, which does not exist; restore it, or "
                      "remove the link",
                      folder_, folder, fs::read_symlink(folder, none).string()));
    throw Error(
        fmt::format("training into {}: cannot list {}: {}", folder_, folder, problem.message()));
  }
}

std::vector<std::string> RunFolder::training() const {
  std::vector<std::string> paths{path("training.json")};
  for (const int step : checkpoints().steps()) paths.push_back(checkpoints().path(step));
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(path("point_cloud"), none))
    if (iteration_of_name(entry.path().filename().string()) >= 0) paths.push_back(entry.path());
  for (const char* name :
       {"metrics.jsonl", "metrics.csv", "input.ply", "input.motion.npz", "moving", "broken.npz"})
    paths.push_back(path(name));
  return those_there(std::move(paths));
}

bool RunFolder::would_remove(const std::string& file) const {
  if (file.empty()) return false;
  const fs::path real = fs::weakly_canonical(file);
  for (const char* name : {"cameras.json", "checkpoints", "flow", "frames", "input.ply", "moving",
                           "point_cloud", "test"}) {
    const fs::path inside = real.lexically_relative(fs::weakly_canonical(path(name)));
    if (!inside.empty() && *inside.begin() != "..") return true;
  }
  return false;
}

std::vector<std::string> RunFolder::results() const {
  std::vector<std::string> paths{path("test"), path("compare.png"), path(kRunReport)};
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder_, none))
    if (is_name_of_results(entry.path().filename().string())) paths.push_back(entry.path());
  return those_there(std::move(paths));
}

void RunFolder::remove_results() const {
  for (const std::string& path : results()) fs::remove_all(path);
}

bool RunFolder::holds_training() const {
  return !checkpoints().steps().empty() || !models().empty() || fs::exists(path("training.json")) ||
         !results().empty();
}

void RunFolder::forget_unfinished_files() const {
  std::vector<fs::path> unfinished;
  const std::function<void(const fs::path&)> look_into = [&](const fs::path& folder) {
    std::error_code problem;
    for (fs::directory_iterator entry(folder, problem), end; !problem && entry != end;
         entry.increment(problem)) {
      const std::string name = entry->path().filename().string();
      const bool is_own = folder == folder_;  // its subfolders may be links to other disks
      const bool trains_there = !is_own || is_name_of_training(name);
      if (is_left_behind(name))
        unfinished.push_back(entry->path());
      else if (trains_there && fs::is_directory(is_own ? entry->status() : entry->symlink_status()))
        look_into(entry->path());
    }
    // A missing folder is fine: another process has removed it.
    if (problem && problem != std::errc::no_such_file_or_directory)
      throw Error(fmt::format("cannot list {}: {}", folder.string(), problem.message()));
  };
  look_into(folder_);
  for (const fs::path& file : unfinished) {
    std::error_code problem;
    fs::remove_all(file, problem);
    if (problem) throw Error(fmt::format("cannot remove {}: {}", file.string(), problem.message()));
  }
}

void RunFolder::remove_stale_caches(const std::string& stamp) const {
  if (has_caches_of(stamp)) return;
  for (const char* folder : {"flow", "frames"}) fs::remove_all(path(folder));
  write_file_atomically(path(kRunStamp), stamp);
}

bool RunFolder::has_caches_of(const std::string& stamp) const {
  return fs::exists(path(kRunStamp)) && stamp == read_report_or_empty(path(kRunStamp));
}

void RunFolder::write_config(const TrainOptions& config) const {
  write_file_atomically(path("config.toml"), to_toml(config));
}

TrainOptions RunFolder::read_config() const {
  TrainOptions kept;
  const std::string checkpoint = last_settings(checkpoints(), kept);
  try {
    TrainOptions config = kept;
    if (fs::is_regular_file(path("config.toml")) && fs::file_size(path("config.toml")) == 0)
      throw Error(fmt::format(
          "reading the configuration {}: it is empty, but should contain all settings of the run",
          path("config.toml")));
    apply_file(config, path("config.toml"));
    check(config);
    return config;
  } catch (const Error& problem) {
    if (checkpoint.empty()) throw;
    warn(fmt::format("{}; using the settings saved in {}", problem.what(), checkpoint));
    return kept;
  }
}

void RunFolder::write_cameras(const FrameStore& frames, float near) const {
  std::vector<Camera> cameras = frames.moved_cameras();
  for (Camera& camera : cameras) camera.near = double(near);
  write_file_atomically(path("cameras.json"), cameras_json(cameras));
}

void RunFolder::move_cameras(FrameStore& frames) const {
  if (!fs::exists(path("cameras.json")))
    throw Error(fmt::format(
        "reading the cameras that training has corrected: {} is missing; restore it, or resume the "
        "training, which writes it again",
        path("cameras.json")));
  const std::vector<Camera> cameras = read_cameras_json(path("cameras.json"), 1);
  const std::vector<Camera> start = frames.moved_cameras();
  bool same = cameras.size() == start.size();
  for (size_t i = 0; same && i < cameras.size(); ++i) same = cameras[i].name == start[i].name;
  if (!same)
    throw Error(fmt::format(
        "reading the cameras that training has corrected: {} has other cameras than the scene; "
        "restore the scene or the file",
        path("cameras.json")));
  for (size_t i = 0; i < cameras.size(); ++i)
    frames.move_camera(i, cameras[i].viewmat, cameras[i].fx / start[i].fx);
}

}  // namespace gflow
