// SPDX-License-Identifier: Apache-2.0
// Files of a run that belong to a model deep inside it.
#pragma once
#include <filesystem>
#include <string>

namespace gflow {

// The file `name` in the folder of a model or up to three above it (RUN/point_cloud/iteration_N);
// empty if there is none.
inline std::string found_above(const std::string& model, const std::string& name) {
  namespace fs = std::filesystem;
  fs::path folder = fs::absolute(model).parent_path();
  for (int level = 0; level < 4; ++level, folder = folder.parent_path())
    if (fs::exists(folder / name)) return (folder / name).string();
  return "";
}

}  // namespace gflow
