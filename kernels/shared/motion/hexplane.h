// SPDX-License-Identifier: Apache-2.0
// The deformation field of the hexplane model (Cao & Johnson 2023; Wu et al. 2024, 4DGaussians).
// Six planes of features over the pairs of x y z t, at each of L levels, are read at a Gaussian's
// canonical mean, linearly, and at the time (HexplaneShape::time_spline), and multiplied within a
// level:
//   f_l = XY_l(x, y) XZ_l(x, z) YZ_l(y, z) XT_l(x, t) YT_l(y, t) ZT_l(z, t)   [C channels]
// The levels, concatenated, are the input of a network (network.h). Its output o is the shift:
//   mean half_size o[0..2], quat o[3..6], log_scales 3 tanh(o[7..9] / 3)
// The tanh limits the change of a size to e^3 = 20 times: without it, sizes of 1e28 and 0 occur
// where no image constrains the field.
//
// Level l has R_l = resolution 2^l cells in x, y and z, and `times` rows in time. The corners of
// the box are cell centres; places outside use the nearest place inside. Rows of the planes, level
// by level: XY [y][x], XZ [z][x], YZ [z][y], then the time planes, [time][axis][cell]. At a fixed
// time these reduce to three lines per level.
#ifndef GFLOW_HEXPLANE_H
#define GFLOW_HEXPLANE_H
#include "shared/dialect.h"

#define HEXPLANE_MAX_LOG_SCALE 3

typedef struct HexplaneGrid {
  int resolution, times;  // cells at level 0, at least 2; rows in time, at least 1
  float centre[3];        // of the box [world]
  float half_size[3];     // [world] > 0
} HexplaneGrid;

// Rows of a level with `times` rows in time (1: of planes reduced to one time), and rows of all
// levels before it.
static inline uint hexplane_level_rows(uint resolution, uint times) {
  return 3 * resolution * (resolution + times);
}
static inline uint hexplane_level_start(uint resolution, uint times, int level) {
  uint rows = 0;
  for (int l = 0; l < level; ++l) rows += hexplane_level_rows(resolution << l, times);
  return rows;
}

// A place between cells `cell` and cell + 1, at fraction `share`. per_world: d (cell + share) / dx.
typedef struct GridPlace {
  uint cell;
  real share, per_world;
} GridPlace;
static inline GridPlace grid_place(real x, real centre, real half_size, int resolution) {
  GridPlace p;
  const real u = (real)0.5f * ((x - centre) / half_size + (real)1);
  const real inside = fmin(fmax(u, (real)0), (real)1);  // NaN becomes 0
  const real place = inside * (real)(resolution - 1);
  const uint cell = (uint)place, last = (uint)resolution - 2;
  p.cell = cell < last ? cell : last;
  p.share = place - (real)p.cell;
  p.per_world = u == inside ? (real)0.5f * (real)(resolution - 1) / half_size : (real)0;
  return p;
}

// Rows in time that a moment reads, row .. row + 3, and their weights. A row outside has weight 0.
typedef struct TimeRows {
  int row;
  float weight[4];
} TimeRows;

// The change of a log scale for a network output, and its derivative, given the change.
static inline real log_scale_change(real output) {
  const real most = (real)HEXPLANE_MAX_LOG_SCALE;
  return most * tanh(output / most);
}
static inline real log_scale_change_slope(real change) {
  const real share = change / (real)HEXPLANE_MAX_LOG_SCALE;
  return (real)1 - share * share;
}

#endif
