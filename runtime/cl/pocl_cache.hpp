// SPDX-License-Identifier: Apache-2.0
// The folder in which PoCL keeps what it compiles. Where that cannot be written PoCL says that it
// has no device, and where it is full LLVM ends the program: both are told before.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"

namespace gflow {

// That PoCL cannot keep what it would compile: no fault of the device.
struct NoRoomForPrograms : Error {
  using Error::Error;
};

// $POCL_CACHE_DIR, else pocl/kcache in $XDG_CACHE_HOME or $HOME/.cache.
std::filesystem::path pocl_cache_folder();

// What is wrong with the folder, which must have `needed` bytes free, and what to do; empty where
// nothing is.
std::string pocl_cache_problem(uint64_t needed);

// The same after something was not compiled: why a file as large as the largest may not be made
// there, as well. A limit on files does not matter where all is compiled already.
std::string why_not_compiled();

}  // namespace gflow
