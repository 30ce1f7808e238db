// SPDX-License-Identifier: Apache-2.0
// From a motion model's marks, one bit per row and LANES rows per mark (shared/motion/culling.h),
// to the ascending list of the rows that a view may show (shared/view_rows.h). One work-item per
// mark, no atomics.
#include "shared/lane.h"

// found: the number of listed rows, and of those below `moving`, which are dynamic.
kernel void view_rows_write(const uint groups, const uint moving,
                            global const uint* restrict marks,    // [groups]
                            global const uint* restrict offsets,  // [groups + 1] bits before each
                            global uint* restrict rows,           // [N]
                            global uint* restrict found) {        // [2]
  const uint g = get_global_id(0);
  if (g >= groups) return;
  if (g == 0) {
    const uint last = moving / LANES, part = (1u << moving % LANES) - 1;
    found[0] = offsets[groups];
    found[1] = last < groups ? offsets[last] + popcount(marks[last] & part) : offsets[groups];
  }
  const uint mark = marks[g];
  if (mark == 0) return;
  uint at = offsets[g];
  for (uint r = 0; r < LANES; ++r)
    if (mark >> r & 1) rows[at++] = g * LANES + r;
}
