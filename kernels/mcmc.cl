// SPDX-License-Identifier: Apache-2.0
// Density control "mcmc" (Kheradmand et al. 2024): dead Gaussians move to live ones, drawn by
// opacity; noise keeps faint ones searching; opacity and size cost a little.
// Only prefix sums and binary searches over random numbers by index: bitwise repeatable.
// Measured (PoCL, two cores with AVX-512, 30 000): in each step mcmc_noise 1.0 ms, mcmc_shrink .22.
#include "shared/arrays.h"
#include "shared/quat.h"
#include "shared/random.h"
#include "shared/relocation.h"

// dead: fainter than the least, or never seen in the video. weights: of the others, opacity x scale
// as a whole number, at least 1.
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
                    life_meets(means_t[i], exp(log_scales[4 * i + 3]), duration, cutoff_sigmas);
  dead[i] = lives ? 0u : 1u;
  weights[i] = lives ? max((uint)(scale / (1.f + exp(-logit))), 1u) : 0u;
}

// Draw k of `count`, from the k-th of as many equal parts of the line on which Gaussian i has the
// stretch offsets[i] .. offsets[i + 1] of `total`: each is drawn in proportion to its weight, with
// less scatter than by draws from the whole line, and drawn[] ascends.
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

// How many of the ascending drawn[0 .. count) are below i.
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

// One work-item a new row: rows of the dead take the first draws, rows behind the old n the rest.
// child: how many others share the place of this row's source.
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

// Those that share a place show together what the one did, but for `spread` standard deviations of
// it by which each is moved; none starts out dead.
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

// Gradient of opacity_weight sum(opacities) + scale_weight sum(scales), for the rows seen.
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

// means += scale gate(opacity) covariance (three normal numbers), for rows seen in this step, so
// that noise and gradients keep their proportion; gate = 1 / (1 + exp(100 (opacity -
// min_opacity))): those about to die search, what is opaque stays. Beyond 0.2 above the least it is
// below 3e-9, left out.
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
