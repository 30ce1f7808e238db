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
    : program_(queue, "motion/still.cl"),
      still_split_(program_, "still_split"),
      still_pace_(program_, "static_rate_scale") {}

void CanonicalRows::set_pace(Queue& queue, Parameters& p, const PaceRule& rule) {
  still_pace_(queue, Range::over(p.count), cl_uint(p.count), rule.duration, rule.power, rule.most,
              p["log_scales"].values, p.rows.pace);
}

void CanonicalRows::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                          const SplitRule& rule, uint32_t seed) {
  still_split_(queue, Range::over(p.count), cl_uint(p.count), seed, rule.split_scale, child,
               p["means"].values, p["quats"].values, p["log_scales"].values,
               p["logit_opacities"].values);
}

}  // namespace gflow
