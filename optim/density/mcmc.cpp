// SPDX-License-Identifier: Apache-2.0
#include "optim/density/mcmc.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {

McmcDensity::McmcDensity(Queue& queue)
    : program_(queue, "density/mcmc.cl"),
      mcmc_weigh_(program_, "mcmc_weigh"),
      mcmc_draw_(program_, "mcmc_draw"),
      mcmc_sources_(program_, "mcmc_sources"),
      mcmc_share_(program_, "mcmc_share"),
      mcmc_shrink_(program_, "mcmc_shrink"),
      mcmc_noise_(program_, "mcmc_noise"),
      rows_(queue),
      scan_(queue) {}

void McmcDensity::add_gradients(Queue& queue, Parameters& p, const DensityRule& rule) {
  if (p.count == 0 || (rule.opacity_weight == 0 && rule.scale_weight == 0)) return;
  const float n = float(p.count);
  mcmc_shrink_(queue, Range::over(p.count), cl_uint(p.count), rule.opacity_weight / n,
               rule.scale_weight / (3 * n), p.rows.seen, p["logit_opacities"].values,
               p["log_scales"].values, p["logit_opacities"].grads, p["log_scales"].grads);
}

void McmcDensity::after_step(Queue& queue, Parameters& p, const GaussiansAt& drawn,
                             const DensityRule& rule, const DensityStep& step) {
  if (rule.noise == 0) return;
  mcmc_noise_(queue, Range::over(p.count), cl_uint(p.count), step.seed,
              rule.noise * step.position_rate, rule.prune_opacity, p.rows.seen,
              p["logit_opacities"].values, drawn.opacities, drawn.factors, p["means"].values);
}

void McmcDensity::refine(Queue& queue, Parameters& p, Motion&, const DensityRule& rule,
                         uint32_t seed) {
  if (p.count == 0) return;
  const cl_uint n = cl_uint(p.count);
  // The finest weights whose sum fits 32 bits.
  const cl_uint scale = std::min(std::numeric_limits<cl_uint>::max() / n, cl_uint(1) << 16);
  const float min_logit = logit(rule.prune_opacity);
  dead_.ensure(queue, n);
  weights_.ensure(queue, n);
  mcmc_weigh_(queue, Range::over(n), n, min_logit, rule.split.duration, window_sigmas(rule.cutoff),
              float(scale), p["logit_opacities"].values, p["log_scales"].values,
              p["means_t"].values, dead_, weights_);
  scan_.exclusive(queue, dead_, dead_offsets_, n);
  const cl_uint dead = cl_uint(scan_.total(queue));
  scan_.exclusive(queue, weights_, offsets_, n);
  const cl_uint total = cl_uint(scan_.total(queue));
  const size_t wanted = std::min(size_t(rule.cap), n + size_t(std::ceil(float(n) * rule.growth)));
  const cl_uint fresh_n = cl_uint(std::max(size_t(n), wanted)), count = dead + fresh_n - n;
  if (count == 0 || total == 0) return;

  drawn_.ensure(queue, count);
  source_.ensure(queue, fresh_n);
  child_.ensure(queue, fresh_n);
  mcmc_draw_(queue, Range::over(count), n, count, total, seed, offsets_, drawn_);
  mcmc_sources_(queue, Range::over(fresh_n), n, fresh_n, count, dead_, dead_offsets_, drawn_,
                source_, child_);
  rows_.move(queue, p, fresh_n, source_, child_, rule.wakes);
  mcmc_share_(queue, Range::over(fresh_n), fresh_n, seed, min_logit, rule.spread, child_,
              p["quats"].values, p["means"].values, p["logit_opacities"].values,
              p["log_scales"].values);
}

}  // namespace gflow
