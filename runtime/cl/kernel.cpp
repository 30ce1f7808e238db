// SPDX-License-Identifier: Apache-2.0
// The signature check and the launch of kernels.
#include "runtime/cl/kernel.hpp"

namespace gflow::detail {
namespace {

// The kernel's spelling of argument i's type, in the form of ClName.
std::string device_spelling(const cl::Kernel& kernel, cl_uint i) {
  std::string type = kernel.getArgInfo<CL_KERNEL_ARG_TYPE_NAME>(i).c_str();
  if (type.rfind("unsigned ", 0) == 0) type = "u" + type.substr(9);  // "unsigned int*" is "uint*"
  if (type.rfind("struct ", 0) == 0) type.erase(0, 7);
  if (kernel.getArgInfo<CL_KERNEL_ARG_ADDRESS_QUALIFIER>(i) != CL_KERNEL_ARG_ADDRESS_GLOBAL)
    return type;
  const bool is_const =
      kernel.getArgInfo<CL_KERNEL_ARG_TYPE_QUALIFIER>(i) & CL_KERNEL_ARG_TYPE_CONST;
  return std::string("global ") + (is_const ? "const " : "") + type;
}

}  // namespace

void check_signature(const cl::Kernel& kernel, const std::string& name,
                     const std::vector<std::string>& host) {
  const auto count = kernel.getInfo<CL_KERNEL_NUM_ARGS>();
  if (count != host.size())
    throw Error(fmt::format("kernel {} takes {} arguments, its host declaration has {}", name,
                            count, host.size()));
  for (cl_uint i = 0; i < count; ++i) {
    std::string device, argument;
    try {
      device = device_spelling(kernel, i);
      argument = kernel.getArgInfo<CL_KERNEL_ARG_NAME>(i).c_str();
    } catch (const cl::Error& cause) {
      // A platform may keep no names, e.g. for a program loaded from its binary.
      if (cause.err() == CL_KERNEL_ARG_INFO_NOT_AVAILABLE) return;
      throw ClError("querying the arguments of kernel " + name, cause);
    }
    if (device != host[i])
      throw Error(fmt::format(
          "kernel {}, argument {} '{}': the kernel takes {}, its host declaration has {}", name, i,
          argument, device, host[i]));
  }
}

void launch(Queue& queue, const cl::Kernel& kernel, const Range& range, cl::Event* event) {
  if (range.dimensions == 1)
    queue.handle.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(range.global_x),
                                      cl::NDRange(range.local_x), nullptr, event);
  else
    queue.handle.enqueueNDRangeKernel(kernel, cl::NullRange,
                                      cl::NDRange(range.global_x, range.global_y),
                                      cl::NDRange(range.local_x, range.local_y), nullptr, event);
}

std::string describe_launch(const std::string& kernel, const Range& range) {
  if (range.dimensions == 1)
    return fmt::format("launching {} on {} work-items in groups of {}", kernel, range.global_x,
                       range.local_x);
  return fmt::format("launching {} on {} x {} work-items in groups of {} x {}", kernel,
                     range.global_x, range.global_y, range.local_x, range.local_y);
}

}  // namespace gflow::detail
