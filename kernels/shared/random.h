// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers: a function of (seed, stream, index) without state, so nothing
// depends on the order of work. Three rounds of PCG's output permutation (O'Neill 2014) in uint
// arithmetic: the same bits on every device.
#ifndef GFLOW_RANDOM_H
#define GFLOW_RANDOM_H
#include "shared/dialect.h"

static inline uint random_mix(uint v) {
  const uint state = v * 747796405u + 2891336453u;
  const uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return (word >> 22u) ^ word;
}
static inline uint random_bits(uint seed, uint stream, uint index) {
  return random_mix(index ^ random_mix(stream ^ random_mix(seed)));
}
// Uniform in (0, 1): never 0, so that its logarithm is finite.
static inline real random_uniform(uint seed, uint stream, uint index) {
  return ((real)(random_bits(seed, stream, index) >> 9) + (real)0.5f) * (real)(1.0f / 8388608.0f);
}
// Two independent standard normal numbers (Box & Muller 1958). Uses `stream` and `stream` + 1.
static inline real2 random_normal2(uint seed, uint stream, uint index) {
  const real radius = sqrt((real)-2 * log(random_uniform(seed, stream, index)));
  const real angle = (real)6.28318531f * random_uniform(seed, stream + 1u, index);
  return make_real2(radius * cos(angle), radius * sin(angle));
}

#endif
