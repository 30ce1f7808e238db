// SPDX-License-Identifier: Apache-2.0
#include "runtime/cl/pocl_cache.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

namespace gflow {
namespace {

namespace fs = std::filesystem;

std::string value_of(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : "";
}

constexpr char kAdvice[] = "set POCL_CACHE_DIR to a writable folder with free space";

// "POCL_CACHE_DIR is FOLDER", or the same without the variable.
std::string name_of_folder() {
  const std::string folder = fs::absolute(pocl_cache_folder()).string();
  return (value_of("POCL_CACHE_DIR").empty() ? "PoCL's cache folder is " : "POCL_CACHE_DIR is ") +
         folder;
}

// The folder, or its nearest existing parent, in which it would be made.
fs::path nearest_existing_parent() {
  fs::path there = fs::absolute(pocl_cache_folder());
  std::error_code problem;
  while (!fs::exists(there, problem) && there.has_relative_path()) there = there.parent_path();
  return there;
}

// errno if a file of `size` bytes cannot be made there because of a full disk, a quota or a limit
// of the shell (ulimit -f); else 0. Leaves no file.
int file_creation_error(uint64_t size, const fs::path& there) {
  const int file = open(there.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600);
  const int why = file >= 0 && fallocate(file, 0, 0, off_t(size)) == 0 ? 0 : errno;
  if (file >= 0) close(file);
  return why == ENOSPC || why == EDQUOT || why == EFBIG ? why : 0;
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
  const fs::path there = nearest_existing_parent();
  std::error_code problem;
  if (!fs::is_directory(there, problem) || access(there.c_str(), W_OK | X_OK) != 0)
    return fmt::format("{}, which is not writable: {}", name_of_folder(), kAdvice);
  const fs::space_info space = fs::space(there, problem);
  if (!problem && space.available < needed)
    return fmt::format(
        "{}, which has only {} MiB free, but compiling needs {} MiB: free some space, or {}",
        name_of_folder(), space.available >> 20, needed >> 20, kAdvice);
  // Free space does not show a quota. (A limit on file sizes does not affect existing programs.)
  if (const int why = file_creation_error(needed, there); why == ENOSPC || why == EDQUOT)
    return fmt::format(
        "{}, where the {} MiB needed for compiling cannot be allocated ({}): free some space, or "
        "{}",
        name_of_folder(), needed >> 20, std::strerror(why), kAdvice);
  return "";
}

std::string compile_failure_reason() {
  constexpr uint64_t largest = uint64_t{1} << 20;  // LLVM's code of the largest kernel: 872 KiB
  if (std::string why = pocl_cache_problem(largest); !why.empty()) return why;
  const int why = file_creation_error(largest, nearest_existing_parent());
  if (!why) return "";
  return fmt::format(
      "{}, where a file of 1 MiB, needed for compiling, cannot be created ({}): raise the limit "
      "(ulimit -f), or {}",
      name_of_folder(), std::strerror(why), kAdvice);
}

}  // namespace gflow
