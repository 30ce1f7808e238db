// SPDX-License-Identifier: Apache-2.0
#include "optim/density/adc.hpp"

#include <cmath>

namespace gflow {

AdcDensity::AdcDensity(Queue& queue)
    : program_(queue, "common.cl"),
      adc_accumulate_(program_, "adc_accumulate"),
      adc_rank_(program_, "adc_rank"),
      adc_grow_(program_, "adc_grow"),
      adc_sources_(program_, "adc_sources"),
      adc_reset_(program_, "adc_reset"),
      adc_reorder_(program_, "adc_reorder"),
      rows_(queue),
      scan_(queue),
      sort_(queue) {}

void AdcDensity::forget(Queue& queue, size_t count) {
  grad2d_.ensure(queue, count);
  views_.ensure(queue, count);
  grad2d_.fill(queue, 0.f);
  views_.fill(queue, 0.f);
}

void AdcDensity::save_state(Queue& queue, Arrays& arrays) const {
  arrays["density/pull"] = {{grad2d_.size()}, grad2d_.read(queue)};
  arrays["density/views"] = {{views_.size()}, views_.read(queue)};
}

void AdcDensity::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  const size_t count = array_named(arrays, "density/pull", path).size();
  const auto& grad2d = exact_values<float>(arrays, "density/pull", {count}, path);
  const auto& views = exact_values<float>(arrays, "density/views", {count}, path);
  forget(queue, count);
  grad2d_.write(queue, grad2d);
  views_.write(queue, views);
}

void AdcDensity::see(Queue& queue, const Parameters& p, const DensityView& view) {
  if (p.count != grad2d_.size()) forget(queue, p.count);
  const size_t n = view.rows.count_of(p);
  adc_accumulate_(queue, Range::over(n), cl_uint(n), 0.5f * float(view.width),
                  0.5f * float(view.height), cl_uint(view.some_ignored), view.rows.buffer(),
                  view.tiles_touched, view.v_means2d, grad2d_, views_);
}

void AdcDensity::reorder(Queue& queue, const Buffer<cl_uint>& source) {
  const size_t count = grad2d_.size();
  if (count == 0) return;  // no view was seen yet
  Buffer<float> grad2d(queue, count, "grad2d"), views(queue, count, "views");
  adc_reorder_(queue, Range::over(count), cl_uint(count), source, grad2d_, views_, grad2d, views);
  grad2d_ = std::move(grad2d);
  views_ = std::move(views);
}

void AdcDensity::after_step(Queue& queue, Parameters& p, const GaussiansAt&,
                            const DensityRule& rule, const DensityStep& step) {
  if (!step.refining || rule.opacity_reset_every == 0 || step.done % rule.opacity_reset_every != 0)
    return;
  ParameterGroup& opacities = p["logit_opacities"];
  adc_reset_(queue, Range::over(p.count), cl_uint(p.count),
             logit(std::min(2 * rule.prune_opacity, 0.99f)), opacities.values, opacities.exp_avg);
}

void AdcDensity::refine(Queue& queue, Parameters& p, Motion& motion, const DensityRule& rule,
                        uint32_t seed) {
  if (grad2d_.size() != p.count) forget(queue, p.count);
  const cl_uint n = cl_uint(p.count);
  copies_.ensure(queue, n);
  keys_.ensure(queue, n);
  order_.ensure(queue, n);
  adc_rank_(queue, Range::over(n), n, rule.grad_threshold, logit(rule.prune_opacity),
            std::log(rule.prune_scale), rule.split.duration, window_sigmas(rule.cutoff),
            p["logit_opacities"].values, p["log_scales"].values, p["means_t"].values, grad2d_,
            views_, copies_, keys_, order_);
  sort_.sort(queue, keys_, order_, n);
  const cl_uint allowed = cl_uint(rule.cap) > n ? cl_uint(rule.cap) - n : 0;
  adc_grow_(queue, Range::over(n), n, allowed, keys_, order_, copies_);
  scan_.exclusive(queue, copies_, offsets_, n);
  const size_t count = size_t(scan_.total(queue));
  source_.ensure(queue, count);
  child_.ensure(queue, count);
  adc_sources_(queue, Range::over(n), n, copies_, offsets_, source_, child_);
  rows_.move(queue, p, count, source_, child_, rule.wakes);
  motion.split(queue, p, child_, rule.split, seed);
  forget(queue, count);
}

}  // namespace gflow
