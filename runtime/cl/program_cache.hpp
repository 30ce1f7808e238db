// SPDX-License-Identifier: Apache-2.0
// Compiled kernels on disk, so that later starts need not compile. A cache never causes a failure:
// what cannot be read, verified or written is compiled from source.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "runtime/cl/queue.hpp"

namespace gflow {

// The driver's bytes in a cache file; empty if it is not a whole cache file or has another `key`.
std::string_view verified_binary(std::string_view file, uint64_t key);

// The place of one program's binary in the cache folder: $GFLOW_CACHE_DIR (empty = no cache), else
// none on PoCL, which has its own, else $XDG_CACHE_HOME/gflow, else ~/.cache/gflow. The key covers
// source, options, device and driver.
class ProgramCache {
 public:
  ProgramCache(const Queue& queue, const std::string& source, const std::string& options);
  // The program, built; a null program if there is no valid binary.
  cl::Program load(Queue& queue, const std::string& options) const;
  void store(const cl::Program& program) const;

 private:
  std::string path_;  // empty: no cache
  uint64_t key_ = 0;  // detects a file under another program's name
};

}  // namespace gflow
