// SPDX-License-Identifier: Apache-2.0
// One text, two languages. Everything in kernels/shared/ is plain C that both OpenCL C 1.2
// (real = float) and C++17 (real = double, the reference of the tests) accept.
// Rules: values in, values out; no address spaces, no library calls beyond those in
// cl_in_cpp.hpp; vectors are made with make_real*() only ("(real3)(x, y, z)" means z in C++).
#ifndef GFLOW_DIALECT_H
#define GFLOW_DIALECT_H
#ifdef __OPENCL_C_VERSION__
// Contraction is ours to decide (explicit fma), so that two kernels agree on the same expression.
#pragma OPENCL FP_CONTRACT OFF
typedef float real;
typedef float2 real2;
typedef float3 real3;
typedef float4 real4;
#define make_real2(x, y) ((real2)((x), (y)))
#define make_real3(x, y, z) ((real3)((x), (y), (z)))
#define make_real4(x, y, z, w) ((real4)((x), (y), (z), (w)))
// A bit test, so that no compiler option can assume it away (numerics 0.11).
static inline int is_finite_real(real x) { return (as_uint(x) & 0x7f800000u) != 0x7f800000u; }
#else
#include "shared/cl_in_cpp.hpp"
#endif
#endif
