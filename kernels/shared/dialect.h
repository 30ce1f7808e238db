// SPDX-License-Identifier: Apache-2.0
// One text, two languages: headers of kernels/shared/ that do not say "OpenCL C only" are accepted
// by both OpenCL C 1.2 (real = float) and C++17 (real = double, the reference of the tests).
// Rules: values in, values out; no address spaces; no library calls beyond those in cl_in_cpp.hpp;
// vectors only by make_real*(), since "(real3)(x, y, z)" means z in C++.
#ifndef GFLOW_DIALECT_H
#define GFLOW_DIALECT_H
#ifdef __OPENCL_C_VERSION__
// No implicit contraction (fma is always explicit): two kernels agree on the same expression.
#pragma OPENCL FP_CONTRACT OFF
typedef float real;
typedef float2 real2;
typedef float3 real3;
typedef float4 real4;
#define make_real2(x, y) ((real2)((x), (y)))
#define make_real3(x, y, z) ((real3)((x), (y), (z)))
#define make_real4(x, y, z, w) ((real4)((x), (y), (z), (w)))
// A bit test, which compiler options cannot optimise away.
static inline int is_finite_real(real x) { return (as_uint(x) & 0x7f800000u) != 0x7f800000u; }
#else
#include "shared/cl_in_cpp.hpp"
#endif
#endif
