// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/sds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

// Builds a schedule from beta(share), share in [0, 1].
template <class Beta>
NoiseSchedule schedule_of(int timesteps, double beta_start, double beta_end, Beta&& beta) {
  if (timesteps < 2 || !(beta_start > 0 && beta_start <= beta_end && beta_end < 1))
    throw Error(
        fmt::format("invalid noise schedule of {} timesteps from beta {} to {}: it needs at least "
                    "2 timesteps and 0 < first <= last < 1",
                    timesteps, beta_start, beta_end));
  NoiseSchedule schedule;
  double left = 1;
  for (int t = 0; t < timesteps; ++t)
    schedule.alphas_cumprod.push_back(left *= 1 - beta(double(t) / (timesteps - 1)));
  return schedule;
}

}  // namespace

NoiseSchedule NoiseSchedule::scaled_linear(int timesteps, double beta_start, double beta_end) {
  const double a = std::sqrt(beta_start), b = std::sqrt(beta_end);
  return schedule_of(timesteps, beta_start, beta_end, [=](double share) {
    const double root = a + share * (b - a);
    return root * root;
  });
}

NoiseSchedule NoiseSchedule::linear(int timesteps, double beta_start, double beta_end) {
  return schedule_of(timesteps, beta_start, beta_end,
                     [=](double share) { return beta_start + share * (beta_end - beta_start); });
}

double t_max_at(const SdsRule& rule, double progress) {
  return rule.t_max + std::clamp(progress, 0.0, 1.0) * (rule.t_max_final - rule.t_max);
}

double timestep_share(const SdsRule& rule, double progress, uint32_t seed, uint32_t view) {
  const double most = std::max(t_max_at(rule, progress), rule.t_min);
  return rule.t_min + double(random_uniform(seed, streams::kTimestep, view)) * (most - rule.t_min);
}

int timestep_at(const NoiseSchedule& schedule, double share) {
  const int last = schedule.timesteps() - 1;
  return std::clamp(int(std::lround(share * schedule.timesteps())), 0, last);
}

std::vector<float> gaussian_noise(uint32_t seed, uint32_t view, size_t count) {
  std::vector<float> noise(count);
  const uint its_seed = random_bits(seed, streams::kLatentNoise, view);
  for (size_t i = 0; i < count; i += 2) {
    const real2 pair = random_normal2(its_seed, streams::kLatentNoise, uint(i / 2));
    noise[i] = float(pair.x);
    if (i + 1 < count) noise[i + 1] = float(pair.y);
  }
  return noise;
}

std::vector<float> guided_noise(Denoiser& denoiser, const NoisyView& view, double scale) {
  const auto asked = [&](bool condition) {
    std::vector<float> noise = denoiser.noise(view, condition);
    if (noise.size() != view.z.size())
      throw GuidanceFailed(fmt::format("{} returned {} values of noise for an image of {}",
                                       denoiser.name(), noise.size(), view.z.size()));
    return noise;
  };
  std::vector<float> noise = asked(true);
  if (scale == 1) return noise;
  const std::vector<float> without = asked(false);
  for (size_t i = 0; i < noise.size(); ++i)
    noise[i] = float(without[i] + scale * (double(noise[i]) - without[i]));
  return noise;
}

std::vector<float> sds_gradient(Denoiser& denoiser, const NoiseSchedule& schedule,
                                const GuidanceRequest& request, const GuidanceView& view,
                                int timestep, const std::vector<float>& noise, double scale) {
  const double alpha_bar = schedule.alphas_cumprod.at(size_t(timestep));
  const double left = std::sqrt(alpha_bar), sigma = std::sqrt(1 - alpha_bar);
  NoisyView noisy{request, view, timestep, alpha_bar, std::vector<float>(view.rgb.size())};
  for (size_t i = 0; i < noisy.z.size(); ++i)
    noisy.z[i] = float(left * (2 * double(view.rgb[i]) - 1) + sigma * noise.at(i));
  std::vector<float> gradient = guided_noise(denoiser, noisy, scale);
  for (size_t i = 0; i < gradient.size(); ++i)
    gradient[i] = float(2 * (1 - alpha_bar) * (double(gradient[i]) - noise[i]));
  return gradient;
}

}  // namespace gflow
