// SPDX-License-Identifier: Apache-2.0
// A .cl file of kernels/ compiled for a queue's device. Built without any maths flag: results must
// not depend on what a compiler may assume (NaN tests, order of sums).
#pragma once
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "runtime/cl/queue.hpp"

namespace gflow {

// The value of a -D: an integer or a text.
struct DefineValue {
  template <class I, class = std::enable_if_t<std::is_integral_v<I>>>
  DefineValue(I value) : text(std::to_string(value)) {}
  DefineValue(const char* value) : text(value) {}
  DefineValue(std::string value) : text(std::move(value)) {}
  std::string text;
};
using Defines = std::vector<std::pair<std::string, DefineValue>>;  // becomes -DNAME=value

// A compiled kernel file. It is built with LANES and GROUP (kernels/shared/work.h) for the device,
// and with `defines`. The same file with the same defines is compiled once per queue, and its
// binary is cached on disk where that pays (program_cache.hpp). GFLOW_KERNEL_DIR names a folder to
// read the kernel files from instead of the embedded texts, for editing without a rebuild.
struct Program {
  // Error if the file or one it includes is missing; ClError with the compiler's log on failure.
  Program(Queue& queue, const std::string& file, const Defines& defines = {});
  std::string file;
  cl::Program handle;
};

// Adds a kernel file of a program that uses gflow, so that it is found by that name and may include
// those of gflow. Error if there is a kernel file of that name.
void register_kernel(const std::string& file, const std::string& text);

// The file with its #include "..." lines expanded, each file once, and with #line marks, so that
// the compiler's messages have our file names and line numbers.
std::string expand_includes(const std::string& file);

}  // namespace gflow
