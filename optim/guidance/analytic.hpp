// SPDX-License-Identifier: Apache-2.0
// A denoiser in closed form. Images y are modelled as a mixture of K Gaussians of equal weight with
// means m_k and variance v per value. Noised to z = sqrt(a) y + sqrt(1 - a) e they are again a
// mixture, with means sqrt(a) m_k and variance s = a v + 1 - a, whose score is
//
//   d log p(z) / dz = -sum_k r_k (z - sqrt(a) m_k) / s,   r_k ~ exp(-|z - sqrt(a) m_k|^2 / (2 s)).
//
// The best estimate of the noise is eps(z) = -sqrt(1 - a) times the score (Vincent 2011). With K =
// 1 the mean of the SDS gradient dL/dy over the noise is (1 - a) sqrt(a (1 - a)) (y - m) / s.
#pragma once
#include <string>
#include <vector>

#include "optim/guidance/denoiser.hpp"
#include "optim/guidance/known_views.hpp"

namespace gflow {

// eps(z) for images in [-1, 1]. At least one mean, each of the size of z; variance >= 0.
std::vector<float> mixture_noise(const std::vector<std::vector<float>>& means, double variance,
                                 double alpha_bar, const std::vector<float>& z);

// A denoiser whose image distribution is a folder of images. With `condition`, a view of a camera
// in the folder has that camera's image as the only mean. Any other view, and any view without
// `condition`, has all images of its time.
class AnalyticDenoiser : public Denoiser {
 public:
  // variance of a value in [-1, 1]. `views` must outlive this.
  AnalyticDenoiser(const KnownViews& views, double variance);
  std::vector<float> noise(const NoisyView& view, bool condition) override;
  std::string name() const override { return "the analytic guidance"; }

 private:
  const KnownViews& views_;
  double variance_;
};

}  // namespace gflow
