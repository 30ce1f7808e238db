// SPDX-License-Identifier: Apache-2.0
// Score distillation against closed forms.
#include "optim/guidance/sds.hpp"

#include <gtest/gtest.h>

#include "apps/stress/training/request.hpp"
#include "optim/guidance/analytic.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// A denoiser for images distributed as a mixture of Gaussians, in [-1, 1].
class Mixture : public Denoiser {
 public:
  Mixture(std::vector<std::vector<float>> means, double variance)
      : means_(std::move(means)), variance_(variance) {}
  std::vector<float> noise(const NoisyView& view, bool) override {
    return mixture_noise(means_, variance_, view.alpha_bar, view.z);
  }
  std::string name() const override { return "a mixture"; }

 private:
  std::vector<std::vector<float>> means_;
  double variance_;
};

std::vector<float> minus(std::vector<float> values) {
  for (float& value : values) value = -value;
  return values;
}

// The last value of Stable Diffusion's schedule is 0.00466, that of DDPM 4.0e-5 (both published).
TEST(NoiseSchedule, HasThePublishedValues) {
  const NoiseSchedule latent = NoiseSchedule::scaled_linear(), ddpm = NoiseSchedule::linear();
  ASSERT_EQ(latent.timesteps(), 1000);
  EXPECT_NEAR(latent.alphas_cumprod.front(), 1 - 0.00085, 1e-12);
  EXPECT_NEAR(latent.alphas_cumprod.back(), 0.00466, 5e-6);
  EXPECT_NEAR(ddpm.alphas_cumprod.front(), 1 - 1e-4, 1e-12);
  EXPECT_NEAR(ddpm.alphas_cumprod.back(), 4.0358e-5, 5e-9);
  for (size_t t = 1; t < 1000; ++t)
    EXPECT_LT(latent.alphas_cumprod[t], latent.alphas_cumprod[t - 1]);
  expect_error([] { NoiseSchedule::linear(1, 0.1, 0.2); }, {"1 timesteps", "2 timesteps"});
  expect_error([] { NoiseSchedule::linear(10, 0.3, 0.2); }, {"0.3 to 0.2"});
}

TEST(SdsRule, TMaxFallsEvenlyAndTimestepsLieBelowIt) {
  const SdsRule rule;
  EXPECT_DOUBLE_EQ(t_max_at(rule, 0), 0.98);
  EXPECT_DOUBLE_EQ(t_max_at(rule, 0.5), 0.5);
  EXPECT_NEAR(t_max_at(rule, 1), 0.02, 1e-12);
  for (const double progress : {0.0, 0.3, 0.9, 1.0}) {
    double least = 1, most = 0;
    for (uint32_t seed = 0; seed < 1000; ++seed) {
      const double share = timestep_share(rule, progress, seed, 0);
      EXPECT_EQ(share, timestep_share(rule, progress, seed, 0));
      least = std::min(least, share);
      most = std::max(most, share);
    }
    const double range = t_max_at(rule, progress) - rule.t_min;
    EXPECT_GE(least, rule.t_min);
    EXPECT_LE(most, rule.t_min + range);
    EXPECT_LE(least, rule.t_min + 0.02 * range);
    EXPECT_GE(most, rule.t_min + 0.98 * range);
  }
  const NoiseSchedule schedule = NoiseSchedule::scaled_linear();
  EXPECT_EQ(timestep_at(schedule, 0), 0);
  EXPECT_EQ(timestep_at(schedule, 0.02), 20);
  EXPECT_EQ(timestep_at(schedule, 1), 999);
}

TEST(GaussianNoise, IsStandardNormalAndItsOwnForEachSeedAndView) {
  const size_t n = 30000;
  const std::vector<float> a = gaussian_noise(1, 0, n), b = gaussian_noise(1, 1, n);
  EXPECT_EQ(a, gaussian_noise(1, 0, n));
  double mean = 0, square = 0, product = 0;
  for (size_t i = 0; i < n; ++i) {
    mean += a[i] / double(n);
    square += double(a[i]) * a[i] / double(n);
    product += double(a[i]) * b[i] / double(n);
  }
  const double deviation = 1 / std::sqrt(double(n));  // of each; sqrt(2) times for the second
  EXPECT_NEAR(mean, 0, 4 * deviation);
  EXPECT_NEAR(square, 1, 6 * deviation);
  EXPECT_NEAR(product, 0, 4 * deviation);
}

// eps = eps_u + s (eps_c - eps_u).
TEST(GuidedNoise, GoesFromWithoutTheConditionThroughWithIt) {
  struct TwoMinded : Denoiser {
    std::vector<float> noise(const NoisyView& view, bool condition) override {
      return std::vector<float>(view.z.size(), condition ? 3.f : 1.f);
    }
    std::string name() const override { return "two minds"; }
  } denoiser;
  const GuidanceRequest request = some_request(1, 2, 2);
  const NoisyView view{request, request.views[0], 0, 0.5, std::vector<float>(12)};
  EXPECT_EQ(guided_noise(denoiser, view, 1)[0], 3);
  EXPECT_EQ(guided_noise(denoiser, view, 0)[0], 1);
  EXPECT_EQ(guided_noise(denoiser, view, 5)[0], 11);
}

// With one Gaussian the gradient is linear in the noise: the mean over e and -e is the mean over
// all, (1 - a) sqrt(a (1 - a)) (y - m) / (a v + 1 - a), and -(1 - a) sqrt(1 - a) times the score at
// the mean of z.
TEST(Sds, MeanGradientIsTheClosedFormScoreOfAGaussian) {
  const GuidanceRequest request = some_request(1, 6, 5);
  const std::vector<float>& x = request.views[0].rgb;
  std::vector<float> mean = some_values(3, x.size());
  for (float& value : mean) value = 2 * value - 1;
  const NoiseSchedule schedule = NoiseSchedule::scaled_linear();
  for (const double variance : {0.0, 0.01, 1.0})
    for (const int t : {20, 300, 700, 980}) {
      Mixture gaussian({mean}, variance);
      const std::vector<float> noise = gaussian_noise(5, 0, x.size());
      const auto one = sds_gradient(gaussian, schedule, request, request.views[0], t, noise, 1);
      const auto other =
          sds_gradient(gaussian, schedule, request, request.views[0], t, minus(noise), 1);
      const double a = schedule.alphas_cumprod[size_t(t)];
      for (size_t i = 0; i < x.size(); ++i) {
        const double y = 2 * double(x[i]) - 1, m = mean[i];
        const double score = -(std::sqrt(a) * y - std::sqrt(a) * m) / (a * variance + 1 - a);
        const double by_y = -(1 - a) * std::sqrt(1 - a) * score;
        EXPECT_NEAR(0.5 * (double(one[i]) + other[i]), 2 * by_y, 1e-4);
      }
    }
}

// Abscissas and weights of Gauss-Hermite quadrature with 20 nodes for the standard normal
// distribution, by Newton's method on the normalised polynomials.
std::vector<std::pair<double, double>> normal_quadrature() {
  constexpr int n = 20;
  const auto values = [](double x) {  // He_n / sqrt(n!) and the one before
    double before = 0, now = 1;
    for (int k = 0; k < n; ++k) {
      const double next = (x * now - std::sqrt(double(k)) * before) / std::sqrt(double(k + 1));
      before = now;
      now = next;
    }
    return std::pair{now, before};
  };
  std::vector<std::pair<double, double>> nodes;
  for (double x = -9; x < 9; x += 0.01) {
    if (values(x).first * values(x + 0.01).first > 0) continue;
    double root = x + 0.005;
    for (int i = 0; i < 50; ++i) {
      const auto [now, before] = values(root);
      root -= now / (std::sqrt(double(n)) * before);
    }
    const double before = values(root).second;
    nodes.emplace_back(root, 1 / (n * before * before));
  }
  return nodes;
}

// With several Gaussians the gradient is not linear. Its mean over the noise, by quadrature on an
// image of one pixel, is w sigma / sqrt(a) times the derivative of E[-log p(z)], computed here by
// differences of the mixture's density alone.
TEST(Sds, MeanGradientIsTheDerivativeOfTheDistanceToAMixture) {
  const std::vector<std::vector<float>> means{{0.5f, -0.2f, 0.1f}, {-0.4f, 0.3f, 0.6f}};
  const double variance = 0.1;
  const NoiseSchedule schedule = NoiseSchedule::scaled_linear();
  const auto nodes = normal_quadrature();
  ASSERT_EQ(nodes.size(), 20u);
  const auto over_noise = [&](const auto& f) {
    for (const auto& [e0, w0] : nodes)
      for (const auto& [e1, w1] : nodes)
        for (const auto& [e2, w2] : nodes) f(std::vector<double>{e0, e1, e2}, w0 * w1 * w2);
  };
  GuidanceRequest request = some_request(1, 1, 1);
  request.views[0].rgb = {0.55f, 0.5f, 0.6f};
  for (const int t : {300, 700}) {
    const double a = schedule.alphas_cumprod[size_t(t)], sigma = std::sqrt(1 - a);
    const double s = a * variance + 1 - a;
    const auto distance = [&](const std::vector<double>& y) {  // E[-log p(z)] up to a constant
      double sum = 0;
      over_noise([&](const std::vector<double>& e, double weight) {
        double p = 0;
        for (const std::vector<float>& m : means) {
          double squared = 0;
          for (size_t c = 0; c < 3; ++c)
            squared += std::pow(std::sqrt(a) * (y[c] - double(m[c])) + sigma * e[c], 2);
          p += std::exp(-squared / (2 * s));
        }
        sum -= weight * std::log(p);
      });
      return sum;
    };
    std::vector<double> mean(3), y(3);
    Mixture mixture(means, variance);
    over_noise([&](const std::vector<double>& e, double weight) {
      const auto gradient = sds_gradient(mixture, schedule, request, request.views[0], t,
                                         {float(e[0]), float(e[1]), float(e[2])}, 1);
      for (size_t c = 0; c < 3; ++c) mean[c] += weight * double(gradient[c]);
    });
    for (size_t c = 0; c < 3; ++c) y[c] = 2 * double(request.views[0].rgb[c]) - 1;
    for (size_t c = 0; c < 3; ++c) {
      constexpr double h = 1e-4;
      std::vector<double> up = y, down = y;
      up[c] += h;
      down[c] -= h;
      const double slope = (distance(up) - distance(down)) / (2 * h);
      EXPECT_NEAR(mean[c], 2 * (1 - a) * sigma / std::sqrt(a) * slope, 1e-4) << t << " " << c;
      EXPECT_GT(std::fabs(mean[c]), 1e-3);  // otherwise the test is trivial
    }
  }
}

TEST(MixtureNoise, TakesTheNearerMeanWhereThereIsLittleNoise) {
  const std::vector<std::vector<float>> means{{0.5f}, {-0.5f}};
  const double a = 0.99, left = std::sqrt(a);
  const std::vector<float> z{float(left * 0.4)};
  EXPECT_NEAR(mixture_noise(means, 0, a, z)[0], std::sqrt(1 - a) * left * (0.4 - 0.5) / (1 - a),
              1e-4);
}

}  // namespace
}  // namespace gflow
