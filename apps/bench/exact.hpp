// SPDX-License-Identifier: Apache-2.0
// What the engine should have found, in double (tests/reference): how wrong images, flow and
// gradients are, by the definition of the image and by one without cut-offs.
#pragma once
#include "apps/bench/scene.hpp"
#include "optim/reference/render.hpp"

namespace gflow::bench {

// Root mean squares over pixels, relative L2 errors over gradients (the worst of the groups).
struct Errors {
  double rgb = 0;        // [of 1]
  double flow_px = 0;    // [px]
  double gradients = 0;  // by means, factors, opacities, colours at t1, means and factors at t2
};

class Exact {
 public:
  // The Gaussians of a scene at both times; takes time and memory by Gaussians x pixels.
  Exact(Queue& queue, BenchScene& scene);

  // A loss by which gradients are compared: random, nothing at pixels where rounding may decide who
  // counts. Planes as in ImageGradients, without depth.
  const reference::Planes& loss() const { return v_; }

  // `as_defined`: by the image's definition with the settings as shipped, at pixels where rounding
  // decides nothing. `without_cutoffs`: every Gaussian counts at every pixel.
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
