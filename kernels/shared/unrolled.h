// SPDX-License-Identifier: Apache-2.0
#ifndef GFLOW_UNROLLED_H
#define GFLOW_UNROLLED_H

// for (i = first; i < end; ++i) over an array of which `end` is known only when it runs and never
// more than `most`. One lane is for devices that keep an array in registers where every index is a
// constant, and else in memory far away: there the loop is written out, and what is not there is
// passed (what that is worth: tests/registers). Elsewhere it ends at once.
#if LANES == 1
#define FOR_UNROLLED(i, first, most, end) \
  _Pragma("unroll") for (int i = (first); i < (most); ++i) if (i < (end))
#else
#define FOR_UNROLLED(i, first, most, end) for (int i = (first); i < (end); ++i)
#endif

#endif
