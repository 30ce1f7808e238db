// SPDX-License-Identifier: Apache-2.0
// Someone who sees the noise in a picture; where score distillation (sds.hpp) gets its opinion.
#pragma once
#include "optim/guidance/guidance.hpp"

namespace gflow {

// A noised picture z and all that a denoiser may know of it. References into a request.
struct NoisyView {
  const GuidanceRequest& request;
  const GuidanceView& view;
  int timestep = 0;      // 0 to T - 1
  double alpha_bar = 0;  // a_t: what is left of the picture's variance
  std::vector<float> z;  // [3, H, W], the picture in [-1, 1] and noise
};

class Denoiser {
 public:
  virtual ~Denoiser() = default;
  // The noise it sees, [3, H, W]. With `condition` it may use what the request says of view, time
  // and reference; without, nothing but z and t. GuidanceFailed when it cannot.
  virtual std::vector<float> noise(const NoisyView& view, bool condition) = 0;
  virtual std::string name() const = 0;
};

}  // namespace gflow
