// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/canonical_rows.hpp"

namespace gflow {

std::vector<GroupSpec> canonical_groups() {
  return {{"means", 3},
          {"means_t", 1, Quantity::time, 0, true},
          {"quats", 4, Quantity::rotation},
          {"log_scales", 4, Quantity::scale},
          {"logit_opacities", 1, Quantity::opacity}};
}

CanonicalRows::CanonicalRows(Queue& queue)
    : program_(queue, "motion/canonical_rows.cl"),
      canonical_split_(program_, "canonical_split"),
      canonical_pace_(program_, "static_rate_scale") {}

void CanonicalRows::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_pace_(queue, Range::over(p.count), cl_uint(p.count), rule.duration, rule.power,
                  rule.most, p["log_scales"].values, p.rows.rate_scale);
}

void CanonicalRows::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                          const SplitRule& rule, uint32_t seed) {
  canonical_split_(queue, Range::over(p.count), cl_uint(p.count), seed, rule.split_scale, child,
                   p["means"].values, p["quats"].values, p["log_scales"].values,
                   p["logit_opacities"].values);
}

}  // namespace gflow
