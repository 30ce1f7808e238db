// SPDX-License-Identifier: Apache-2.0
#include "optim/density/static_detection.hpp"

namespace gflow {

StaticDetection::StaticDetection(Queue& queue)
    : program_(queue, "density/static_detection.cl"),
      static_add_(program_, "static_add"),
      static_pose_(program_, "static_pose_of"),
      static_travel_(program_, "static_travel"),
      static_accumulate_(program_, "static_accumulate"),
      static_decide_(program_, "static_decide"),
      static_settle_(program_, "static_settle"),
      rows_(queue) {}

void StaticDetection::start_sums(Queue& queue, const Parameters& p) {
  gradient_sums_.ensure(queue, 4 * (p.count - p.moving));
  if (!sums_known_) gradient_sums_.fill(queue, 0.f);
  sums_known_ = true;
}

void StaticDetection::see(Queue& queue, const Parameters& p, const ViewRows& rows,
                          const Buffer<cl_uint>& tiles_touched, float t,
                          const Buffer<float>& v_means, const float* t2,
                          const Buffer<float>& v_means_t2, bool stood_still) {
  const size_t static_count = p.count - p.moving;
  if (static_count == 0) return;
  start_sums(queue, p);
  static_accumulate_(queue, Range::over(rows.count() - rows.moving()), cl_uint(rows.count()),
                     cl_uint(rows.moving()), cl_uint(p.moving), t, t2 ? *t2 : t,
                     t2 ? 1 + int(stood_still) : 0, rows.list().buffer(), tiles_touched,
                     p["means_t"].values, v_means, t2 ? v_means_t2 : v_means, gradient_sums_);
}

const Buffer<cl_uint>& StaticDetection::refine(Queue& queue, Parameters& p, Motion& motion,
                                               const StaticRule& rule) {
  const size_t m = p.moving;
  Buffer<float> means(queue, 3 * m, "static means"), quats(queue, 4 * m, "static quats");
  Buffer<float> factors(queue, 9 * m, "static factors"), weights(queue, m, "static weights");
  Buffer<float> travel(queue, m, "travel");
  Buffer<cl_uint> moments(queue, m, "moments"), moves(queue, p.count, "moves");
  for (Buffer<float>* sums : {&means, &factors, &weights, &travel}) sums->fill(queue, 0.f);
  moments.fill(queue, 0u);
  const cl_uint moving = cl_uint(m);
  const Buffer<float>& log_scales = p["log_scales"].values;
  GaussiansAt at;
  const auto at_each_moment = [&](auto&& use) {
    for (int k = 0; k < rule.moments && m > 0; ++k) {
      motion.at(queue, p, rule.duration * float(k) / float(rule.moments - 1), nullptr, at);
      use();
    }
  };
  at_each_moment([&] {
    static_add_(queue, Range::over(m), moving, at.means, at.factors, at.opacities, means, factors,
                weights, moments);
  });
  static_pose_(queue, Range::over(m), moving, log_scales, factors, weights, means, quats);
  at_each_moment([&] {
    static_travel_(queue, Range::over(m), moving, log_scales, means, quats, at.means, at.factors,
                   at.opacities, travel);
  });
  start_sums(queue, p);
  source_.ensure(queue, p.count);
  child_.ensure(queue, p.count);
  static_decide_(queue, Range::over(p.count), cl_uint(p.count), moving, rule.most, rule.trial,
                 rule.wake, travel, moments, p.rows.steps, gradient_sums_, moves, source_, child_);
  rows_.move(queue, p, p.count, moves, source_, child_);
  static_settle_(queue, Range::over(p.count - p.moving), cl_uint(p.count), cl_uint(p.moving),
                 moving, source_, means, quats, p["means"].values, p["quats"].values);
  forget();
  return source_;
}

void StaticDetection::save_state(Queue& queue, const Parameters& p, Arrays& arrays) const {
  const size_t static_count = p.count - p.moving;
  arrays["rest/pulls"] = {{static_count, 4},
                          sums_known_ ? gradient_sums_.read_range(queue, 0, 4 * static_count)
                                      : std::vector<float>(4 * static_count, 0.f)};
}

void StaticDetection::load_state(Queue& queue, const Parameters& p, const Arrays& arrays,
                                 const std::string& path) {
  const auto& sums = exact_values<float>(arrays, "rest/pulls", {p.count - p.moving, 4}, path);
  forget();
  start_sums(queue, p);
  gradient_sums_.write(queue, sums);
}

}  // namespace gflow
