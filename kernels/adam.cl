// SPDX-License-Identifier: Apache-2.0
// Adam over rows first .. first + rows - 1 of parameters. A row with seen[row] == 0 keeps every bit
// of its values and moments. Order within a training step: adam_refuse for every group,
// adam_advance once, then adam_step for every group. Repeatable bit for bit: no two work-items
// share an element.
#include "shared/adam.h"

#ifndef FLAT
#define FLAT 0  // 1: one work-item per scalar (GPUs: neighbours read neighbours); 0: per row
#endif

// One work-item per row: a row with a gradient that Adam cannot take is skipped in all groups.
kernel void adam_refuse(const uint first, const uint rows, const uint width,
                        global const float* restrict grads,  // [rows, width]
                        global uint* restrict seen,          // [rows] becomes 0 if refused
                        global uint* restrict refused) {     // [rows] becomes 1 if refused
  const uint row = first + get_global_id(0);
  if (row >= first + rows || seen[row] == 0) return;
  int accepted = 1;
  for (uint k = 0; k < width; ++k) accepted &= adam_accepts(grads[(size_t)row * width + k]);
  if (accepted) return;
  seen[row] = 0;
  refused[row] = 1;
}

// One work-item per row: counts the step that seen rows are about to make.
kernel void adam_advance(const uint first, const uint rows,
                         global const uint* restrict seen,  // [rows]
                         global uint* restrict steps) {     // [rows]
  const uint row = first + get_global_id(0);
  if (row < first + rows && seen[row] != 0) ++steps[row];
}

// One work-item per row, or per scalar if FLAT.
kernel void adam_step(const uint first, const uint rows, const uint width, const AdamStep step,
                      const int per_time, const uint table_size,
                      global const float* restrict corrections,  // [table_size, 2] by step count
                      global const uint* restrict seen,          // [rows]
                      global const uint* restrict steps,         // [rows] from 1
                      global const float* restrict pace,         // [rows] multiplies the rate
                      global const float* restrict reach,   // [rows] divides it, per_time times
                      global const float* restrict grads,   // [rows, width]
                      global float* restrict values,        // [rows, width]
                      global float* restrict exp_avg,       // [rows, width]
                      global float* restrict exp_avg_sq) {  // [rows, width]
#if FLAT
  const size_t begin = (size_t)first * width + get_global_id(0), end = begin + 1;
  const size_t row = begin / width;
#else
  const size_t row = first + get_global_id(0);
  const size_t begin = row * width, end = begin + width;
#endif
  if (row >= first + rows || seen[row] == 0) return;
  float2 correction = vload2(min(steps[row], table_size - 1), corrections);
  correction.x *= pace[row];
  for (int k = 0; k < per_time; ++k) correction.x /= reach[row];
  for (size_t i = begin; i < end; ++i) {
    AdamState s;
    s.value = values[i];
    s.exp_avg = exp_avg[i];
    s.exp_avg_sq = exp_avg_sq[i];
    s = adam_update(s, grads[i], step, correction.x, correction.y);
    values[i] = s.value;
    exp_avg[i] = s.exp_avg;
    exp_avg_sq[i] = s.exp_avg_sq;
  }
}
