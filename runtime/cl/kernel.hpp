// SPDX-License-Identifier: Apache-2.0
// A kernel as a C++ function. Its host signature is checked against the compiled kernel's own when
// the object is made, so a swapped, missing or mistyped argument fails at start, by name.
#pragma once
#include <string>
#include <vector>

#include "runtime/cl/buffer.hpp"
#include "runtime/cl/program.hpp"

namespace gflow {

// The number of work-items and their groups. Always whole groups, so kernels test their bounds.
struct Range {
  // n work-items, rounded up to whole groups of `local`.
  static Range over(size_t n, size_t local = 64) {
    return {(n + local - 1) / local * local, 1, local, 1, 1};
  }
  // `count` groups of `local` work-items; local = 1: one work-item per tile or chunk.
  static Range groups(size_t count, size_t local) { return {count * local, 1, local, 1, 1}; }
  // width x height work-items, each rounded up to whole groups of local_x x local_y.
  static Range grid(size_t width, size_t height, size_t local_x = 16, size_t local_y = 16) {
    return {(width + local_x - 1) / local_x * local_x, (height + local_y - 1) / local_y * local_y,
            local_x, local_y, 2};
  }
  size_t global_x, global_y, local_x, local_y;
  int dimensions;
};

namespace detail {

// The OpenCL C spelling of a host argument type.
template <class T>
struct ClName;
template <class T>
struct ClName<In<T>> {
  static std::string get() { return "global const " + ClName<T>::get() + "*"; }
};
template <class T>
struct ClName<Out<T>> {
  static std::string get() { return "global " + ClName<T>::get() + "*"; }
};

// Error that names the first argument in which the kernel and its host declaration differ.
void check_signature(const cl::Kernel& kernel, const std::string& name,
                     const std::vector<std::string>& host);

// Queues the kernel; `event` may be null.
void launch(Queue& queue, const cl::Kernel& kernel, const Range& range, cl::Event* event);

std::string describe_launch(const std::string& kernel, const Range& range);

template <class T>
void set_arg(cl::Kernel& kernel, cl_uint i, const T& value) {
  kernel.setArg(i, value);
}
template <class T>
void set_arg(cl::Kernel& kernel, cl_uint i, const In<T>& buffer) {
  kernel.setArg(i, buffer.handle);
}
template <class T>
void set_arg(cl::Kernel& kernel, cl_uint i, const Out<T>& buffer) {
  kernel.setArg(i, buffer.handle);
}

}  // namespace detail

#define GFLOW_CL_NAME(T, SPELLING)                \
  template <>                                     \
  struct gflow::detail::ClName<T> {               \
    static std::string get() { return SPELLING; } \
  }

// For a struct of kernels/shared/ (global namespace) that kernels take by value. Use after its
// definition, outside of any namespace:
//   GFLOW_KERNEL_STRUCT(Camera);
#define GFLOW_KERNEL_STRUCT(T) GFLOW_CL_NAME(T, #T)

}  // namespace gflow

GFLOW_CL_NAME(cl_float, "float");
GFLOW_CL_NAME(cl_int, "int");
GFLOW_CL_NAME(cl_uint, "uint");
GFLOW_CL_NAME(cl_uchar, "uchar");
GFLOW_CL_NAME(cl_ushort, "ushort");
GFLOW_CL_NAME(cl_ulong, "ulong");

namespace gflow {

// Kernel<cl_uint, In<float>, Out<float>> scale(program, "scale");
// scale(queue, Range::over(n), n, values, result);
template <class... Args>
class Kernel {
 public:
  Kernel(const Program& program, const std::string& name) : name_(name) {
    handle_ = cl_call("finding kernel " + name + " in " + program.file,
                      [&] { return cl::Kernel(program.handle, name.c_str()); });
    detail::check_signature(handle_, name, {detail::ClName<Args>::get()...});
  }

  // Queues one launch; does nothing for an empty range. ClError names the kernel and the range.
  void operator()(Queue& queue, const Range& range, Args... args) {
    if (range.global_x == 0 || range.global_y == 0) return;
    cl::Event event;
    try {
      cl_uint i = 0;
      (detail::set_arg(handle_, i++, args), ...);
      detail::launch(queue, handle_, range, queue.keeps_events() ? &event : nullptr);
    } catch (const cl::Error& cause) {
      throw ClError(detail::describe_launch(name_, range), cause);
    }
    queue.launched(name_, event);
  }

 private:
  std::string name_;
  cl::Kernel handle_;
};

}  // namespace gflow
