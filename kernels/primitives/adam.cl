// SPDX-License-Identifier: Apache-2.0
// Adam over rows first .. first + rows - 1 of parameters. A row with seen[row] == 0 keeps every bit
// of its values and moments; once it is seen again, its moments decay by the steps it missed. Order
// within a training step: adam_refuse for every group, adam_advance once, adam_step for every
// group. Bitwise repeatable: no two work-items share an element.
// CPUs (LANES > 1) process ADAM_SPAN rows per work-item in vectors, since their floats are
// neighbours in memory. Faster than one row per work-item; of a span without seen rows, adam_step
// reads one byte.
#include "shared/adam.h"
#include "shared/lane_row.h"
#include "shared/work.h"

// Rejects a row with a gradient that Adam cannot use: all groups skip it.
static inline void reject_row(size_t row, uint width, global const float* grads, global uint* seen,
                              global uint* rejected) {
  if (seen[row] == 0) return;
  int accepted = 1;
  for (uint k = 0; k < width; ++k) accepted &= is_usable_gradient(grads[row * width + k]);
  if (accepted) return;
  seen[row] = 0;
  rejected[row] = min(max(rejected[row], 1u) + 1, 0x7fffffffu);
}

kernel void adam_refuse(const uint first, const uint rows, const uint width,
                        global const float* restrict grads,  // [rows, width]
                        global uint* restrict seen,          // [rows] becomes 0 if rejected
                        global uint* restrict rejected) {    // [rows] RowState::rejected
#if LANES == 1
  if (get_global_id(0) < rows) reject_row(first + get_global_id(0), width, grads, seen, rejected);
#else
  const size_t begin = (size_t)get_global_id(0) * ADAM_SPAN;
  if (begin >= rows) return;
  const size_t span = min((size_t)ADAM_SPAN, rows - begin), count = span * width;
  uint any_seen = 0;
  for (size_t r = 0; r < span; ++r) any_seen |= seen[first + begin + r];
  if (!any_seen) return;
  global const float* g = grads + (first + begin) * width;
  lane_int bad = 0;  // set by stale gradients of unseen rows, too
  size_t i = 0;
  for (; i + LANES <= count; i += LANES) {
    const lane x = ROW_LOAD(g + i);
    bad |= (LANE_AS_INT(x * x) & 0x7f800000) == 0x7f800000;
  }
  int rest = 0;
  for (; i < count; ++i) rest |= !is_usable_gradient(g[i]);
  if (!rest && !lane_any(bad)) return;
  for (size_t row = first + begin; row < first + min(begin + ADAM_SPAN, (size_t)rows); ++row)
    reject_row(row, width, grads, seen, rejected);
#endif
}

// Advances a seen row to its step number `now` and returns its AdamRow, correction1 times
// rate_scale. Steps count from a row's first gradient on, since it has no moments to decay before.
// Without makes_up, missed steps do not count. For unseen rows correction2 is -1.
static inline float4 advance_row(size_t row, uint now, int makes_up, uint table_size,
                                 global const float* table, global const uint* seen,
                                 global const float* rate_scale, global uint* steps,
                                 global uint* last, global uint* rejected) {
  if (seen[row] == 0) return (float4)(0.f, -1.f, 0.f, 0.f);
  rejected[row] = min(rejected[row], 1u);
  const uint before = steps[row];
  const uint missed = before == 0 || !makes_up ? 0 : now - last[row] - 1;
  // Beyond the table everything is as at its end; the counter must not wrap.
  steps[row] = min(before + missed + 1, 0x7fffffffu);
  last[row] = now;
  float4 rate;
  rate.xy = vload4(min(steps[row], table_size - 1), table).xy;
  rate.zw = vload4(min(missed, table_size - 1), table).zw;
  rate.x *= rate_scale[row];
  return rate;
}

// One work-item per row, or per ADAM_SPAN rows. For a span without seen rows only `idle` is set,
// which is all that adam_step then reads of it.
kernel void adam_advance(const uint first, const uint rows, const uint now, const int makes_up,
                         const uint table_size,
                         global const float* restrict table,  // [table_size, 4] AdamRow by steps
                         global const uint* restrict seen,    // [rows]
                         global const float* restrict rate_scale,  // [rows] learning-rate scale
                         global uint* restrict steps,              // [rows]
                         global uint* restrict last,               // [rows] number of its last step
                         global uint* restrict rejected,           // [rows] at most 1 again if seen
                         global float* restrict rates,             // [rows, 4]
                         global uchar* restrict idle) {            // [spans] 1: no row is seen
#if LANES == 1
  const size_t row = first + get_global_id(0);
  if (row >= (size_t)first + rows) return;
  vstore4(
      advance_row(row, now, makes_up, table_size, table, seen, rate_scale, steps, last, rejected),
      row, rates);
#else
  const size_t begin = first + (size_t)get_global_id(0) * ADAM_SPAN, all = (size_t)first + rows;
  if (begin >= all) return;
  const size_t end = min(begin + ADAM_SPAN, all);
  uint any_seen = 0;
  for (size_t row = begin; row < end; ++row) any_seen |= seen[row];
  idle[get_global_id(0)] = any_seen == 0;
  if (!any_seen) return;
  for (size_t row = begin; row < end; ++row)
    vstore4(
        advance_row(row, now, makes_up, table_size, table, seen, rate_scale, steps, last, rejected),
        row, rates);
#endif
}

#define ADAM_ARRAYS                                                  \
  global const float* restrict grads, global float* restrict values, \
      global float* restrict exp_avg, global float* restrict exp_avg_sq
#define ADAM_ARRAYS_AT grads, values, exp_avg, exp_avg_sq

static inline void update_one(size_t i, AdamStep step, float4 c, ADAM_ARRAYS) {
  const AdamRow row = {c.x, c.y, c.z, c.w};
  AdamState s;
  s.value = values[i];
  s.exp_avg = step.beta1 > 0.f ? exp_avg[i] : 0.f;
  s.exp_avg_sq = exp_avg_sq[i];
  s = adam_update(s, grads[i], step, row);
  values[i] = s.value;
  if (step.beta1 > 0.f) exp_avg[i] = s.exp_avg;
  exp_avg_sq[i] = s.exp_avg_sq;
}

#if LANES > 1
typedef struct LaneRow {
  lane x, y, z, w;  // one AdamRow per lane
} LaneRow;

// adam_update on LANES floats from i on; lanes with y < 0 keep every bit.
static inline void update_lanes(size_t i, AdamStep step, LaneRow c, ADAM_ARRAYS) {
  const lane g = ROW_LOAD(grads + i), value = ROW_LOAD(values + i);
  const lane v = ROW_LOAD(exp_avg_sq + i);
  const lane_int counts = c.y >= TO_LANE(0.f);
  lane m2 = g;
  if (step.beta1 > 0.f) {
    const lane m = ROW_LOAD(exp_avg + i);
    m2 = ADAM_MEAN(step.beta1, c.z, m, g);
    ROW_STORE(LANE_SELECT(m, m2, counts), exp_avg + i);
  }
  const lane v2 = ADAM_MEAN(step.beta2, c.w, v, g * g);
  ROW_STORE(LANE_SELECT(value, ADAM_MOVED(value, step, c.x, c.y, m2, v2), counts), values + i);
  ROW_STORE(LANE_SELECT(v, v2, counts), exp_avg_sq + i);
}
#endif

// One work-item per scalar, or per ADAM_SPAN rows. exp_avg may be null if beta1 is 0.
kernel void adam_step(
    const uint first, const uint rows, const uint width, const AdamStep step, const int per_time,
    global const float* restrict rates,         // [rows, 4] from adam_advance
    global const uchar* restrict idle,          // [spans] from adam_advance
    global const float* restrict rate_divisor,  // [rows] rate divisor, per_time times
    ADAM_ARRAYS) {                              // [rows, width]
#if LANES == 1
  const size_t i = (size_t)first * width + get_global_id(0), row = i / width;
  if (row >= first + rows) return;
  float4 c = vload4(row, rates);
  if (c.y < 0.f) return;
  for (int k = 0; k < per_time; ++k) c.x /= rate_divisor[row];
  update_one(i, step, c, ADAM_ARRAYS_AT);
#else
  const size_t begin = first + (size_t)get_global_id(0) * ADAM_SPAN, all = first + rows;
  if (begin >= all) return;
  if (idle[get_global_id(0)]) return;
  const uint count = (uint)min((size_t)ADAM_SPAN, all - begin);
  float4 c[ADAM_SPAN];
  for (uint r = 0; r < count; ++r) {
    c[r] = vload4(begin + r, rates);
    for (int k = 0; k < per_time; ++k) c[r].x /= rate_divisor[begin + r];
  }
  if (width < LANES && count == ADAM_SPAN) {
    // The rows' floats one after the other: whole vectors, each float with the factors of its row.
    float x[ADAM_SPAN * LANES], y[ADAM_SPAN * LANES], z[ADAM_SPAN * LANES], w[ADAM_SPAN * LANES];
    for (uint r = 0, e = 0; r < ADAM_SPAN; ++r)
      for (uint k = 0; k < width; ++k, ++e) {
        x[e] = c[r].x;
        y[e] = c[r].y;
        z[e] = c[r].z;
        w[e] = c[r].w;
      }
    for (uint e = 0; e < ADAM_SPAN * width; e += LANES) {
      const LaneRow row = {ROW_LOAD(x + e), ROW_LOAD(y + e), ROW_LOAD(z + e), ROW_LOAD(w + e)};
      update_lanes(begin * width + e, step, row, ADAM_ARRAYS_AT);
    }
    return;
  }
  for (uint r = 0; r < count; ++r) {
    if (c[r].y < 0.f) continue;
    const size_t start = (begin + r) * width;
    const LaneRow row = {TO_LANE(c[r].x), TO_LANE(c[r].y), TO_LANE(c[r].z), TO_LANE(c[r].w)};
    uint k = 0;
    for (; k + LANES <= width; k += LANES) update_lanes(start + k, step, row, ADAM_ARRAYS_AT);
    for (; k < width; ++k) update_one(start + k, step, c[r], ADAM_ARRAYS_AT);
  }
#endif
}
