// SPDX-License-Identifier: Apache-2.0
#ifndef GFLOW_UNROLLED_H
#define GFLOW_UNROLLED_H

// for (i = first; i < end; ++i) over an array whose length `end` is known only at run time and is
// at most `most`. With LANES 1 the loop is unrolled to `most` and skips the iterations from `end`
// on: GPU compilers keep an array in registers only if every index is a constant (see
// tests/registers). Otherwise a plain loop.
#if LANES == 1
#define FOR_UNROLLED(i, first, most, end) \
  _Pragma("unroll") for (int i = (first); i < (most); ++i) if (i < (end))
#else
#define FOR_UNROLLED(i, first, most, end) for (int i = (first); i < (end); ++i)
#endif

#endif
