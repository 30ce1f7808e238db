// SPDX-License-Identifier: Apache-2.0
// A denoiser in closed form. Pictures y are known to be distributed as a mixture of K Gaussians of
// equal weight, means m_k and variance v in each value. Noised to z = sqrt(a) y + sqrt(1 - a) e
// they are again such a mixture, means sqrt(a) m_k and variance s = a v + 1 - a, whose score is
//
//   d log p(z) / dz = -sum_k r_k (z - sqrt(a) m_k) / s,   r_k ~ exp(-|z - sqrt(a) m_k|^2 / (2 s)),
//
// and the best guess of the noise is eps(z) = -sqrt(1 - a) times that (Vincent 2011). With K = 1
// the mean of the SDS gradient dL/dy over the noise is (1 - a) sqrt(a (1 - a)) (y - m) / s.
#pragma once
#include <string>
#include <vector>

#include "optim/guidance/denoiser.hpp"
#include "optim/guidance/known_views.hpp"

namespace gflow {

// eps(z) for pictures in [-1, 1]; each mean has the size of z, there is at least one. variance >=
// 0.
std::vector<float> mixture_noise(const std::vector<std::vector<float>>& means, double variance,
                                 double alpha_bar, const std::vector<float>& z);

// Pictures of a folder as the known distribution. With the condition a view of a camera the folder
// knows has its picture alone; any other view, and without the condition all, have all pictures of
// that time.
class AnalyticDenoiser : public Denoiser {
 public:
  // variance of a value in [-1, 1]. `views` must outlive it.
  AnalyticDenoiser(const KnownViews& views, double variance);
  std::vector<float> noise(const NoisyView& view, bool condition) override;
  std::string name() const override { return "the analytic guidance"; }

 private:
  const KnownViews& views_;
  double variance_;
};

}  // namespace gflow
