// SPDX-License-Identifier: Apache-2.0
// Everything gflow throws. An error is one clear sentence for the person who must act: what was
// being done, to what, what is wrong, what would be right.
#pragma once
#include <stdexcept>
#include <string>
#include <utility>

#include "runtime/opencl.hpp"

namespace gflow {

// A text of a file may have zeros, at which what() would end: they become "\\0".
inline std::string without_zeros(std::string text) {
  for (size_t at = text.find('\0'); at != text.npos; at = text.find('\0', at + 2))
    text.replace(at, 1, "\\0");
  return text;
}

// Base of all errors of gflow; what() is a full sentence for the user.
struct Error : std::runtime_error {
  explicit Error(std::string sentence) : std::runtime_error(without_zeros(std::move(sentence))) {}
};

// An array that is larger than the device gives.
struct OutOfMemory : Error {
  using Error::Error;
};

// An OpenCL call that failed: what we were doing, which call, its code by name, and for a failed
// build the compiler's log.
struct ClError : Error {
  ClError(const std::string& doing, const cl::Error& cause);
  cl_int code;
};

// Whether it is for want of device memory that something failed: an OutOfMemory, or a ClError with
// one of OpenCL's codes for that.
bool is_out_of_memory(const Error& error);

// "CL_INVALID_VALUE" for -30, and so on; "an unknown OpenCL error" for codes outside OpenCL 1.2.
const char* cl_code_name(cl_int code);

// Runs f; an OpenCL failure in it becomes a ClError that starts with `doing`.
template <class F>
auto cl_call(const std::string& doing, F&& f) -> decltype(f()) {
  try {
    return std::forward<F>(f)();
  } catch (const cl::Error& cause) {
    throw ClError(doing, cause);
  }
}

}  // namespace gflow
