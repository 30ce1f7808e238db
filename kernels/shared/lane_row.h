// SPDX-License-Identifier: Apache-2.0
// Lanes over consecutive elements in memory (OpenCL C only), for passes over rows or flat arrays.
// In lane.h, by contrast, the lanes form a 4x4 cell of the image.
#ifndef GFLOW_LANE_ROW_H
#define GFLOW_LANE_ROW_H
#include "shared/lane.h"

// Load, store and sum LANES values from p on, in any address space and without alignment.
// ROW_COLUMN: the index of each lane.
#if LANES == 1
#define ROW_LOAD(p) (*(p))
#define ROW_STORE(v, p) (*(p) = (v))
#define ROW_SUM(v) (v)
#define ROW_COLUMN 0
#else
#define ROW_LOAD(p) LANE_JOIN(vload, LANES)(0, p)
#define ROW_STORE(v, p) LANE_JOIN(vstore, LANES)(v, 0, p)
#define ROW_SUM(v) lane_sum(v)
#if LANES == 16
#define ROW_COLUMN ((lane_int)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#elif LANES == 8
#define ROW_COLUMN ((lane_int)(0, 1, 2, 3, 4, 5, 6, 7))
#else
#define ROW_COLUMN ((lane_int)(0, 1, 2, 3))
#endif
#endif

// The same at the end of a row or array, where only `count` values exist (all, if count >= LANES).
// Missing lanes read as 0 and are not written.
static inline lane row_load(global const float* p, int count) {
  if (count >= LANES) return ROW_LOAD(p);
  float values[LANES];
  for (int k = 0; k < LANES; ++k) values[k] = k < count ? p[k] : 0.0f;
  return ROW_LOAD(values);
}
static inline lane row_load_bytes(global const uchar* p, int count) {
  if (count >= LANES) return LANE_FROM_INT(ROW_LOAD(p));
  float values[LANES];
  for (int k = 0; k < LANES; ++k) values[k] = k < count ? p[k] : 0.0f;
  return ROW_LOAD(values);
}
static inline void row_store(lane v, global float* p, int count) {
  if (count >= LANES) {
    ROW_STORE(v, p);
    return;
  }
  float values[LANES];
  ROW_STORE(v, values);
  for (int k = 0; k < count; ++k) p[k] = values[k];
}

#endif
