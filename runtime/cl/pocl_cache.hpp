// SPDX-License-Identifier: Apache-2.0
// The folder in which PoCL keeps compiled programs. If it cannot be written PoCL reports no device,
// and if it is full LLVM ends the program: gflow checks both before.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"

namespace gflow {

// PoCL cannot keep what it would compile; the device is not at fault.
struct NoRoomForPrograms : Error {
  using Error::Error;
};

// $POCL_CACHE_DIR, else pocl/kcache in $XDG_CACHE_HOME, $HOME/.cache or /tmp.
std::filesystem::path pocl_cache_folder();

// What is wrong with the folder, which must have `needed` bytes free, and what to do; else empty.
std::string pocl_cache_problem(uint64_t needed);

// The same after a compilation failed; checks also whether a file as large as the largest kernel's
// may be made. (Not before, since a limit on file sizes does not matter if all is compiled
// already.)
std::string compile_failure_reason();

}  // namespace gflow
