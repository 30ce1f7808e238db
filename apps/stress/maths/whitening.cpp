// SPDX-License-Identifier: Apache-2.0
// T5, T6: the determinant from minors and the exponent |K d|^2, for splats from 1 to 1e4 px long.
#include "apps/stress/splats.hpp"
#include "apps/stress/stress.hpp"
#include "optim/engine/exact_covariance.hpp"

namespace gflow::stress {
namespace {

constexpr int kWhitened = 20000;
constexpr double kThinnest = 0.3;  // [px] across, before dilation

Rows determinants(Queue& queue) {  // T5
  Rows rows;
  DeviceMaths device(queue);
  for (const bool mixed : {false, true})
    for (const double length : {1., 10., 100., 1e3, 1e4}) {
      Random random(5);
      Floats m;
      for (int i = 0; i < kWhitened; ++i)
        add_factor(m, random_axes(random, length, kThinnest), mixture(random, mixed));
      const Floats dets = device.whiten(m, Floats(2 * kWhitened)).dets;
      std::vector<double> errors;
      for (int i = 0; i < kWhitened; ++i)
        errors.push_back(std::fabs(double(dets[i]) / ExactCovariance(&m[6 * size_t(i)]).det() - 1));
      rows.push_back({fmt::format("{:.0f} px{}, worst of {}", length,
                                  mixed ? ", columns mixed" : "", kWhitened),
                      worst(errors), 5e-7});
    }
  return rows;
}

// Pixels at true q = |z|^2 up to 9.
Rows exponents(Queue& queue) {  // T6
  Rows rows;
  DeviceMaths device(queue);
  for (const auto& [length, bound] :
       {std::pair{10., 1e-4}, {100., 2e-4}, {1e3, 2e-3}, {1e4, 2e-2}}) {
    Random random(6);
    Floats m, d;
    std::vector<double> expected;
    for (int i = 0; i < kWhitened; ++i) {
      add_factor(m, random_axes(random, length, kThinnest), mixture(random, true));
      const Whitening w = whiten(factor_at(m, i));
      const double radius = 3 * std::sqrt(random.uniform(0, 1)), angle = random.angle();
      const double z1 = radius * std::cos(angle), z2 = radius * std::sin(angle);
      const float dx = float(w.u1 * z1 + w.u2 * z2), dy = float(w.u3 * z2);  // d = inv(K) z
      d.insert(d.end(), {dx, dy});
      expected.push_back(ExactCovariance(&m[6 * size_t(i)]).distance2(double(dx), double(dy)));
    }
    const Floats z = device.whiten(m, d).z;
    std::vector<double> errors;
    double not_finite = 0;
    for (int i = 0; i < kWhitened; ++i) {
      const float q = z[2 * i] * z[2 * i] + z[2 * i + 1] * z[2 * i + 1];
      errors.push_back(std::fabs(double(q) - expected[i]));
      not_finite += !std::isfinite(q);
    }
    rows.push_back({fmt::format("{:.0f} px, 99.9 % of q", length), quantile(errors, .999), bound});
    rows.push_back(
        {fmt::format("{:.0f} px, q, a sum of squares, non-finite", length), not_finite, 0});
  }
  return rows;
}

}  // namespace

Tests whitening_tests() {
  return {{"T5", "determinant from minors", true, determinants},
          {"T6", "exponent from the whitening", true, exponents}};
}

}  // namespace gflow::stress
