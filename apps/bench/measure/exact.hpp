// SPDX-License-Identifier: Apache-2.0
// Errors of the engine's images, flow and gradients against the double reference (optim/reference):
// with the cut-offs of the image definition, and without any.
#pragma once
#include "apps/bench/measure/scene.hpp"
#include "optim/reference/render.hpp"

namespace gflow::bench {

// Root mean square over pixels; relative L2 over gradients (the worst group).
struct Errors {
  double rgb = 0;        // [of 1]
  double flow_px = 0;    // [px]
  double gradients = 0;  // by means, factors, opacities, colours at t1, means and factors at t2
};

class Exact {
 public:
  // The Gaussians of a scene at both times. Time and memory grow with Gaussians x pixels.
  Exact(Queue& queue, BenchScene& scene);

  // A random loss for comparing gradients, 0 at pixels where rounding may decide which Gaussians
  // contribute. Planes as in ImageGradients, without depth.
  const reference::Planes& loss() const { return v_; }

  // as_defined: the default image definition, without pixels where rounding may decide.
  // without_cutoffs: every Gaussian contributes to every pixel.
  struct Found {
    Errors as_defined, without_cutoffs;
  };
  Found compare(Queue& queue, const Images& images, const GaussianGradients& gradients) const;

 private:
  struct Truth {
    reference::Planes images;
    reference::Gaussians gradients;
  };
  Truth truth_of(const reference::Contributors* fixed) const;
  Errors errors(const std::vector<float>& rgb, const std::vector<float>& flow,
                const std::vector<std::vector<float>>& gradients, const Truth& truth,
                bool skip_doubtful) const;

  reference::Shot shot_;
  reference::Gaussians gaussians_;
  std::vector<uint8_t> doubtful_;
  reference::Planes v_;
  Truth as_defined_, without_cutoffs_;
};

}  // namespace gflow::bench
