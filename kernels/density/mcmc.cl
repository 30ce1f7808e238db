// SPDX-License-Identifier: Apache-2.0
// Density control "mcmc" (Kheradmand et al. 2024): dead Gaussians are relocated to live ones,
// sampled by opacity; noise lets faint ones explore; opacity and size are penalised. Uses prefix
// sums, binary searches and counter-based random numbers only: bitwise repeatable.
#include "shared/arrays.h"
#include "shared/quat.h"
#include "shared/random.h"
#include "shared/relocation.h"

// dead: 1 if the opacity is below the least or the Gaussian is never visible in [0, duration].
// weights: opacity x scale as an integer, at least 1, and 0 for dead ones.
kernel void mcmc_weigh(const uint n, const float min_logit_opacity, const float duration,
                       const float cutoff_sigmas, const float scale,
                       global const float* restrict logit_opacities,
                       global const float* restrict log_scales,  // [N, 4]
                       global const float* restrict means_t, global uint* restrict dead,
                       global uint* restrict weights) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float logit = logit_opacities[i];
  const int lives = logit >= min_logit_opacity &&  // NaN fails
                    is_visible_in_video(means_t[i], exp(log_scales[4 * i + 3]), duration, cutoff_sigmas);
  dead[i] = lives ? 0u : 1u;
  weights[i] = lives ? max((uint)(scale / (1.f + exp(-logit))), 1u) : 0u;
}

// Stratified sampling: draw k falls into the k-th of `count` equal parts of [0, total), in which
// Gaussian i has the interval offsets[i] .. offsets[i + 1]. Each is drawn in proportion to its
// weight, with less variance than by independent draws, and drawn[] ascends.
kernel void mcmc_draw(const uint n, const uint count, const uint total, const uint seed,
                      global const uint* restrict offsets,  // [N + 1]
                      global uint* restrict drawn) {        // [count]
  const uint k = get_global_id(0);
  if (k >= count) return;
  const ulong within = mul_hi(random_bits(seed, 0u, k), total);
  const uint place = (uint)(((ulong)k * total + within) / count);
  uint low = 0, high = n;  // offsets[low] <= place < offsets[high]
  while (high - low > 1) {
    const uint middle = low + (high - low) / 2;
    if (offsets[middle] <= place)
      low = middle;
    else
      high = middle;
  }
  drawn[k] = low;
}

// Number of elements of the ascending drawn[0 .. count) below i.
static inline uint drawn_below(global const uint* drawn, uint count, uint i) {
  uint low = 0, high = count;
  while (low < high) {
    const uint middle = low + (high - low) / 2;
    if (drawn[middle] < i)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

// One work-item per new row: dead rows take the first draws, rows behind the old n the others.
// child: how many other rows have the same source.
kernel void mcmc_sources(const uint n, const uint fresh_n, const uint count,
                         global const uint* restrict dead, global const uint* restrict dead_offsets,
                         global const uint* restrict drawn, global uint* restrict source,
                         global uint* restrict child) {
  const uint j = get_global_id(0);
  if (j >= fresh_n) return;
  uint from = j;
  if (j >= n)
    from = drawn[dead_offsets[n] + j - n];
  else if (dead[j])
    from = drawn[dead_offsets[j]];
  source[j] = from;
  child[j] = drawn_below(drawn, count, from + 1) - drawn_below(drawn, count, from);
}

// The Gaussians of one source look like it together, except that each is moved by a random offset
// of `spread` standard deviations. Opacities are at least min_logit_opacity: none starts out dead.
kernel void mcmc_share(const uint n, const uint seed, const float min_logit_opacity,
                       const float spread, global const uint* restrict child,
                       global const float* restrict quats,  // [N, 4]
                       global float* restrict means,        // [N, 3]
                       global float* restrict logit_opacities,
                       global float* restrict log_scales) {  // [N, 4]
  const uint i = get_global_id(0);
  if (i >= n || child[i] == 0) return;
  const float copies = 1.f + child[i], logit = logit_opacities[i];
  const float less = log(shared_scale(logit, copies));
  const float4 s = vload4(i, log_scales);
  const float2 a = random_normal2(seed, 4u, i), b = random_normal2(seed, 6u, i);
  const Mat3 l = factor_of(vload4(i, quats), spread * make_real3(exp(s.x), exp(s.y), exp(s.z)));
  const float3 xi = make_real3(a.x, a.y, b.x);
  add3(means, i, make_real3(dot(l.r1, xi), dot(l.r2, xi), dot(l.r3, xi)));
  vstore4(s + (float4)(less, less, less, 0.f), i, log_scales);
  logit_opacities[i] = fmax(shared_opacity_logit(logit, copies), min_logit_opacity);
}

// Adds the gradient of opacity_weight sum(opacities) + scale_weight sum(scales), for seen rows.
kernel void mcmc_shrink(const uint n, const float opacity_weight, const float scale_weight,
                        global const uint* restrict seen,
                        global const float* restrict logit_opacities,
                        global const float* restrict log_scales,  // [N, 4]
                        global float* restrict v_logit_opacities,
                        global float* restrict v_log_scales) {  // [N, 4]
  const uint i = get_global_id(0);
  if (i >= n || seen[i] == 0) return;
  const float logit = logit_opacities[i], opacity = 1.f / (1.f + exp(-logit));
  v_logit_opacities[i] += opacity_weight * opacity / (1.f + exp(logit));  // as life_vjp
  const float4 s = vload4(i, log_scales), v = vload4(i, v_log_scales);
  vstore4(v + scale_weight * (float4)(exp(s.x), exp(s.y), exp(s.z), 0.f), i, v_log_scales);
}

// means += scale gate(opacity) covariance (three normal numbers), with
//   gate = 1 / (1 + exp(100 (opacity - min_opacity))):
// nearly dead Gaussians explore, opaque ones stay. Only for rows seen in this step, so that noise
// and gradients keep their proportion. The gate is skipped where it is below 3e-9: opacities over
// min_opacity + 0.2.
kernel void mcmc_noise(const uint n, const uint seed, const float scale, const float min_opacity,
                       global const uint* restrict seen,  // [N]
                       global const float* restrict logit_opacities,
                       global const float* restrict opacities_at,  // [N] 0: not in the last view
                       global const float* restrict factors_at,    // [N, 3, 3]
                       global float* restrict means) {             // [N, 3]
  const uint i = get_global_id(0);
  if (i >= n || seen[i] == 0 || !(opacities_at[i] > 0.f)) return;
  const float above = 1.f / (1.f + exp(-logit_opacities[i])) - min_opacity;
  if (!(above < 0.2f)) return;
  const float2 a = random_normal2(seed, 0u, i), b = random_normal2(seed, 2u, i);
  const Mat3 l = load_mat3(factors_at, i);
  const float3 y = l.r1 * a.x + l.r2 * a.y + l.r3 * b.x;  // L^T xi
  const float3 step = (scale / (1.f + exp(100.f * above))) *
                      make_real3(dot(l.r1, y), dot(l.r2, y), dot(l.r3, y));
  if (is_finite_real(step.x + step.y + step.z)) add3(means, i, step);
}
