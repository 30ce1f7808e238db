// SPDX-License-Identifier: Apache-2.0
// Score distillation sampling (Poole et al. 2022, DreamFusion, eq. 3): the gradient of an image
// from a denoiser. With an image x in [0, 1], y = 2 x - 1, noise e ~ N(0, 1) and a timestep t,
//
//   z = sqrt(a_t) y + sqrt(1 - a_t) e,   dL/dy = w(t) (eps(z; t) - e),   w(t) = 1 - a_t,
//
// where a_t is the schedule's cumulative alpha (alphas_cumprod) and w is DreamFusion's sigma_t^2.
// The derivative of the denoiser is omitted. The mean over e is then the gradient of a distance
// between the noised image and the denoiser's distribution of noised images: with its score s(z)
// and eps = -sqrt(1 - a_t) s it is -w(t) sqrt(1 - a_t) E s(z) (analytic.hpp has s in closed form).
#pragma once
#include <cstdint>
#include <vector>

#include "optim/guidance/denoiser.hpp"

namespace gflow {

// Fraction of an image's variance left at each of T timesteps.
struct NoiseSchedule {
  std::vector<double> alphas_cumprod;  // [T]; decreasing, in (0, 1)

  // beta_t = (sqrt(b0) + t / (T - 1) (sqrt(b1) - sqrt(b0)))^2, a_t = prod (1 - beta_s): the "scaled
  // linear" schedule of latent diffusion (Rombach et al. 2022; Stable Diffusion, Zero123). Error
  // unless T >= 2 and 0 < b0 <= b1 < 1.
  static NoiseSchedule scaled_linear(int timesteps = 1000, double beta_start = 0.00085,
                                     double beta_end = 0.012);
  // beta_t = b0 + t / (T - 1) (b1 - b0), as in DDPM (Ho et al. 2020). Errors as scaled_linear.
  static NoiseSchedule linear(int timesteps = 1000, double beta_start = 1e-4,
                              double beta_end = 0.02);
  int timesteps() const { return int(alphas_cumprod.size()); }
};

// Range of timesteps and strength of the condition.
struct SdsRule {
  double t_min = 0.02;        // smallest timestep, as a fraction of T
  double t_max = 0.98;        // largest timestep at first,
  double t_max_final = 0.02;  // and at the end: falls linearly (GaussianFlow, appendix)
  double scale = 1;           // s of eps = eps_u + s (eps_c - eps_u); 1: only the condition
};

// Largest timestep, as a fraction of T, at `progress` in [0, 1] of the guided steps.
double t_max_at(const SdsRule& rule, double progress);
// A timestep for a view, as a fraction of T: uniform in [t_min, t_max_at()] by seed and view; t_min
// if t_max_at() is below t_min.
double timestep_share(const SdsRule& rule, double progress, uint32_t seed, uint32_t view);
// Index of a timestep, 0 to T - 1.
int timestep_at(const NoiseSchedule& schedule, double share);
// `count` independent standard normal numbers by seed and view.
std::vector<float> gaussian_noise(uint32_t seed, uint32_t view, size_t count);

// Classifier-free guidance: eps_u + s (eps_c - eps_u) (Ho & Salimans 2021). With s = 1 the denoiser
// runs once.
std::vector<float> guided_noise(Denoiser& denoiser, const NoisyView& view, double scale);

// dL/dx [3, H, W] = 2 dL/dy for the rendered image of a view, with this noise.
std::vector<float> sds_gradient(Denoiser& denoiser, const NoiseSchedule& schedule,
                                const GuidanceRequest& request, const GuidanceView& view,
                                int timestep, const std::vector<float>& noise, double scale);

}  // namespace gflow
