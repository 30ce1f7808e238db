// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/analytic.hpp"

#include <algorithm>
#include <cmath>

namespace gflow {

std::vector<float> mixture_noise(const std::vector<std::vector<float>>& means, double variance,
                                 double alpha_bar, const std::vector<float>& z) {
  const double left = std::sqrt(alpha_bar), s = alpha_bar * variance + 1 - alpha_bar;
  std::vector<double> share(means.size());  // log r_k, then r_k
  for (size_t k = 0; k < means.size(); ++k) {
    double squared = 0;
    for (size_t i = 0; i < z.size(); ++i) {
      const double d = z[i] - left * means[k].at(i);
      squared += d * d;
    }
    share[k] = -squared / (2 * s);
  }
  const double most = *std::max_element(share.begin(), share.end());
  double sum = 0;
  for (double& r : share) sum += r = std::exp(r - most);
  std::vector<float> noise(z.size());
  for (size_t i = 0; i < z.size(); ++i) {
    double mean = 0;
    for (size_t k = 0; k < means.size(); ++k) mean += share[k] / sum * means[k][i];
    noise[i] = float(std::sqrt(1 - alpha_bar) * (z[i] - left * mean) / s);
  }
  return noise;
}

AnalyticDenoiser::AnalyticDenoiser(const KnownViews& views, double variance)
    : views_(views), variance_(variance) {}

std::vector<float> AnalyticDenoiser::noise(const NoisyView& view, bool condition) {
  std::vector<std::vector<float>> means = views_.images(view.request, view.view, condition);
  for (std::vector<float>& mean : means)
    for (float& value : mean) value = 2 * value - 1;
  return mixture_noise(means, variance_, view.alpha_bar, view.z);
}

}  // namespace gflow
