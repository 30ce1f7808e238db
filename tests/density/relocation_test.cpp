// SPDX-License-Identifier: Apache-2.0
// The relocation formula against the double sum of the paper, and its purpose.
#include "shared/relocation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/compare.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

double logit_of(double p) { return std::log(p / (1 - p)); }

// Kheradmand et al. 2024, eq. 9: the factor of the scales, by the printed sum.
double paper_scale(double opacity, int n) {
  const double x = 1 - std::pow(1 - opacity, 1. / n);
  double sum = 0;
  for (int i = 1; i <= n; ++i) {
    double binomial = 1;  // C(i - 1, k)
    for (int k = 0; k < i; ++k) {
      sum += binomial * (k % 2 ? -1 : 1) * std::pow(x, k + 1) / std::sqrt(k + 1.);
      binomial *= double(i - 1 - k) / (k + 1);
    }
  }
  return opacity / sum;
}

TEST(Relocation, OneAloneStaysAsItIs) {
  for (const double logit : {-8., -1., 0., 3., 12.}) {
    EXPECT_NEAR(shared_opacity_logit(logit, 1), logit, 1e-10);
    EXPECT_NEAR(shared_scale(logit, 1), 1, 1e-7);  // 0.5641895 is a rounded constant
  }
}

TEST(Relocation, OpacitiesMultiplyToTheOldOne) {
  for (const double opacity : {0.001, 0.02, 0.4, 0.9, 0.9999})
    for (const int n : {2, 3, 10, 300})
      EXPECT_NEAR(std::pow(1 - sigmoid(shared_opacity_logit(logit_of(opacity), n)), n), 1 - opacity,
                  1e-12);
}

// The sum loses digits in double as 2^n x^n: a valid reference up to about n = 30.
TEST(Relocation, SizesFollowThePaper) {
  std::vector<double> ours, paper;
  for (const double opacity : {0.005, 0.1, 0.5, 0.9, 0.99, 0.9999})
    for (const int n : {1, 2, 3, 5, 12, 30}) {
      ours.push_back(shared_scale(logit_of(opacity), n));
      paper.push_back(paper_scale(opacity, n));
    }
  EXPECT_TRUE(all_close(ours, paper, {1e-6, 0}));
  EXPECT_LT(ours.back(), 0.8);  // and they do shrink
}

// For large n, against a finer quadrature, because the sum is too inaccurate.
TEST(Relocation, HoldsForHundreds) {
  for (const double opacity : {0.1, 0.9, 0.9999}) {
    const double n = 1000, x = sigmoid(shared_opacity_logit(logit_of(opacity), n));
    double sum = 0;
    const double h = 1. / 512;
    for (int k = -4096; k <= 4096; ++k) {
      const double u = k * h;
      sum -= h * std::expm1(n * std::log1p(-x * std::exp(-u * u)));
    }
    const double expected = opacity / (sum / std::sqrt(std::acos(-1.)));
    EXPECT_NEAR(shared_scale(logit_of(opacity), n) / expected, 1, 1e-6);
  }
}

TEST(Relocation, LogitsFarOutStayFinite) {
  for (const double logit : {-100., -40., 40., 100., 700.})
    for (const double n : {1., 2., 50.}) {
      EXPECT_TRUE(std::isfinite(shared_opacity_logit(logit, n))) << logit << " " << n;
      EXPECT_GT(shared_scale(logit, n), 0) << logit << " " << n;
      EXPECT_LE(shared_scale(logit, n), 1 + 1e-6) << logit << " " << n;
    }
}

}  // namespace
}  // namespace gflow
