// SPDX-License-Identifier: Apache-2.0
#include "runtime/pocl_cache.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace gflow {
namespace {

namespace fs = std::filesystem;

std::string value_of(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : "";
}

}  // namespace

fs::path pocl_cache_folder() {
  if (const std::string own = value_of("POCL_CACHE_DIR"); !own.empty()) return own;
  if (const std::string all = value_of("XDG_CACHE_HOME"); !all.empty())
    return fs::path(all) / "pocl/kcache";
  if (const std::string home = value_of("HOME"); !home.empty())
    return fs::path(home) / ".cache/pocl/kcache";
  return "/tmp/pocl/kcache";
}

std::string pocl_cache_problem(uint64_t needed) {
  const fs::path folder = fs::absolute(pocl_cache_folder());
  const std::string name = value_of("POCL_CACHE_DIR").empty()
                               ? "PoCL keeps its programs in " + folder.string()
                               : "POCL_CACHE_DIR is " + folder.string();
  constexpr char advice[] = "set POCL_CACHE_DIR to a folder that can be written and has room";
  fs::path there = folder;  // or the nearest above it, in which it would be made
  std::error_code problem;
  while (!fs::exists(there, problem) && there.has_relative_path()) there = there.parent_path();
  if (!fs::is_directory(there, problem) || access(there.c_str(), W_OK | X_OK) != 0)
    return fmt::format("{}, where nothing can be written: {}", name, advice);
  const fs::space_info space = fs::space(there, problem);
  if (!problem && space.available < needed)
    return fmt::format("{}, where {} MiB are left, and compiling takes {}: make room, or {}", name,
                       space.available >> 20, needed >> 20, advice);
  return "";
}

}  // namespace gflow
