// SPDX-License-Identifier: Apache-2.0
// OpenCL failures as errors of gflow.
#pragma once
#include <string>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/cl/opencl.hpp"

namespace gflow {

// An array that is larger than the device can allocate.
struct OutOfMemory : Error {
  using Error::Error;
};

// A failed OpenCL call: what was being done, which call, its code by name, and for a failed build
// the compiler's log.
struct ClError : Error {
  ClError(const std::string& doing, const cl::Error& cause);
  cl_int code;
};

// Whether an error means that device memory ran out: an OutOfMemory, or a ClError with one of
// OpenCL's codes for that.
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
