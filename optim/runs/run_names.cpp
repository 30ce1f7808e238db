// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_names.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <regex>
#include <set>

#include "optim/cameras/find_cameras.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

namespace fs = std::filesystem;

bool is_made_by_training(const fs::path& folder) {
  std::error_code none;
  if (fs::exists(folder / kRunStamp, none) || fs::exists(folder / kRunBegun, none)) return true;
  if (fs::exists(folder / kRunScene / kMadeFrom, none)) return true;
  if (!fs::exists(folder / "config.toml", none)) return false;
  for (const char* trained : {"checkpoints", "point_cloud"})
    for (const auto& entry : fs::directory_iterator(folder / trained, none))
      if (entry.path().filename().string().rfind("iteration_", 0) == 0) return true;
  return false;
}

bool is_name_of_results(const std::string& name) {
  static const std::regex pattern(
      R"((results|per_view)(_(test|train|val))?(_iteration_\d+)?\.json)");
  return std::regex_match(name, pattern);
}

bool is_name_of_training(const std::string& name) {
  static const std::set<std::string> names = {
      kRunLock,           kRunScene,     "broken.npz",  "cameras.json",  kRunStamp,
      "checkpoints",      "compare.png", "config.toml", "flow",          "frames",
      "input.motion.npz", "input.ply",   "metrics.csv", "metrics.jsonl", "moving",
      "point_cloud",      kRunReport,    kRunNotices,   "test",          "training.json"};
  return names.count(name) || is_name_of_results(name);
}

std::string temporary_folder_name(const std::string& stem) {
  return fmt::format("{}.{}-0.part", stem, ::getpid());
}

bool is_left_behind(const std::string& filename) {
  if (!is_temporary_name(filename)) return false;
  static const std::regex pattern(R"(.*\.(\d+)-\d+\.part(\..*)?)");
  std::smatch found;
  std::regex_match(filename, found, pattern);
  const std::string pid = found[1], own = std::to_string(::getpid());
  // An earlier process had this number, for example in a container.
  if (pid == own) return true;
  const auto program_of = [](const std::string& process) {
    std::string name;
    std::getline(std::ifstream("/proc/" + process + "/comm"), name);
    return name;  // "" if there is no such process
  };
  const std::string program = program_of(pid);
  return program.empty() || program != program_of(own);
}

}  // namespace gflow
