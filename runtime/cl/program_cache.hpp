// SPDX-License-Identifier: Apache-2.0
// Compiled kernels on disk, so that a second start need not compile. A cache is never a reason to
// fail: what cannot be read, checked or written is compiled from source as if it were not there.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "runtime/cl/queue.hpp"

namespace gflow {

// The driver's bytes in a file of the cache; empty where it is no such file, not whole, or another
// program's, which `key` tells.
std::string_view sound_binary(std::string_view file, uint64_t key);

// The place of one program's binary in the cache folder: $GFLOW_CACHE_DIR (empty = no cache), else
// none on PoCL, which keeps its own, else $XDG_CACHE_HOME/gflow, else ~/.cache/gflow. The key
// covers source, options, device and driver.
class ProgramCache {
 public:
  ProgramCache(const Queue& queue, const std::string& source, const std::string& options);
  // The program, built; a null program when there is no sound binary.
  cl::Program load(Queue& queue, const std::string& options) const;
  void store(const cl::Program& program) const;

 private:
  std::string path_;  // empty: no cache
  uint64_t key_ = 0;  // a file under another's name is not taken for its own
};

}  // namespace gflow
