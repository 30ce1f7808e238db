// SPDX-License-Identifier: Apache-2.0
#include "optim/io/run_names.hpp"

#include <regex>
#include <set>

namespace gflow {

namespace fs = std::filesystem;

bool is_made_by_training(const fs::path& folder) {
  std::error_code none;
  if (fs::exists(folder / kRunStamp, none)) return true;
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
      kRunLock,        "broken.npz",       "cameras.json", kRunStamp,
      "checkpoints",   "compare.png",      "config.toml",  "flow",
      "frames",        "input.motion.npz", "input.ply",    "metrics.csv",
      "metrics.jsonl", "point_cloud",      "test",         "training.json"};
  return names.count(name) || is_name_of_results(name);
}

}  // namespace gflow
