// SPDX-License-Identifier: Apache-2.0
// The only place that includes the OpenCL C++ headers and configures them: version 1.2, and every
// failing call throws cl::Error (which cl_call() of cl_error.hpp turns into a sentence).
#pragma once
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>
