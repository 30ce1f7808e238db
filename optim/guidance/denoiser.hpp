// SPDX-License-Identifier: Apache-2.0
// A noise predictor, as score distillation (sds.hpp) needs.
#pragma once
#include "optim/guidance/guidance.hpp"

namespace gflow {

// A noised image z and what a denoiser may know about it. Holds references into a request.
struct NoisyView {
  const GuidanceRequest& request;
  const GuidanceView& view;
  int timestep = 0;      // 0 to T - 1
  double alpha_bar = 0;  // a_t, the fraction of the image's variance that is left
  std::vector<float> z;  // [3, H, W]; image in [-1, 1], with noise added
};

class Denoiser {
 public:
  virtual ~Denoiser() = default;
  // The predicted noise, [3, H, W]. With `condition` it may use view, time and reference of the
  // request; without only z and t. GuidanceFailed if it cannot.
  virtual std::vector<float> noise(const NoisyView& view, bool condition) = 0;
  virtual std::string name() const = 0;
};

}  // namespace gflow
