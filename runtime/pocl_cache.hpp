// SPDX-License-Identifier: Apache-2.0
// The folder in which PoCL keeps what it compiles. Where that cannot be written PoCL says that it
// has no device, and where it is full LLVM ends the program: both are told before.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

namespace gflow {

// $POCL_CACHE_DIR, else pocl/kcache in $XDG_CACHE_HOME or $HOME/.cache.
std::filesystem::path pocl_cache_folder();

// What is wrong with the folder, which must have `needed` bytes free, and what to do; empty where
// nothing is.
std::string pocl_cache_problem(uint64_t needed);

}  // namespace gflow
