// SPDX-License-Identifier: Apache-2.0
// The arrays the engine takes and gives back. N Gaussians, M intersections with tiles, H x W
// pixels; images are planes, row by row.
#pragma once
#include <array>

#include "runtime/cl/kernel.hpp"
#include "shared/types.h"

GFLOW_KERNEL_STRUCT(PinholeCamera);

namespace gflow {

// Gaussians at one time, from whatever motion model. Covariance = L L^T with the factor L, so that
// every model shares the engine. Opacity 0: not there at this time.
struct GaussiansAt {
  Buffer<float> means{"means"};          // [N, 3] world
  Buffer<float> factors{"factors"};      // [N, 3, 3]
  Buffer<float> opacities{"opacities"};  // [N] in [0, 1]

  void ensure(Queue& queue, size_t n) {
    means.ensure(queue, 3 * n);
    factors.ensure(queue, 9 * n);
    opacities.ensure(queue, n);
  }
};

// Gradients of a loss by the arrays above and by the colours; undefined for what was not seen.
struct GaussianGradients {
  Buffer<float> v_means{"v_means"}, v_factors{"v_factors"}, v_opacities{"v_opacities"};
  Buffer<float> v_colors{"v_colors"};                                    // [N, 3]
  Buffer<float> v_means_t2{"v_means_t2"}, v_factors_t2{"v_factors_t2"};  // with flow only
  Buffer<float> v_means_t0{"v_means_t0"}, v_factors_t0{"v_factors_t0"};  // by a motion loss only
  Buffer<float> v_means2d{"v_means2d"};  // [N, 2] by the projected mean, from the pictures [1/px];
                                         // (a, a) with absgrad: sqrt(2) a = sum of |gradient|

  void ensure(Queue& queue, size_t n) {
    v_means.ensure(queue, 3 * n);
    v_factors.ensure(queue, 9 * n);
    v_opacities.ensure(queue, n);
    v_colors.ensure(queue, 3 * n);
    v_means_t2.ensure(queue, 3 * n);
    v_factors_t2.ensure(queue, 9 * n);
    v_means2d.ensure(queue, 2 * n);
  }
  // Of n rows, all 0: what is not seen stays so.
  void zero(Queue& queue, size_t n) {
    ensure(queue, n);
    for (Buffer<float>* v :
         {&v_means, &v_factors, &v_opacities, &v_colors, &v_means_t2, &v_factors_t2, &v_means2d})
      v->fill(queue, 0.f);
  }
};

struct Images {
  int width = 0, height = 0;
  Buffer<float> rgb{"rgb"};      // [3, H, W] background included
  Buffer<float> alpha{"alpha"};  // [H, W] sum of weights
  Buffer<float> depth{"depth"};  // [H, W] sum of weight x depth; with Channels::depth
  Buffer<float> flow{"flow"};    // [2, H, W] sum w f / sum w [px], 0 where nothing is drawn
  Buffer<float> flow_weight{"flow_weight"};      // [H, W] with top_k only
  Buffer<float> transmittance{"transmittance"};  // [H, W] what passes through all splats
  // [H, W] entries of the tile's list until the pixel is full, for the way back; with top_k
  // [2, H, W], the second until its flow is.
  Buffer<cl_int> ends{"ends"};
  std::array<float, 3> background{};  // drawn behind all splats
};

// Gradients of a loss by the images; sizes as there. depth and flow only with their channel.
struct ImageGradients {
  Buffer<float> v_rgb{"v_rgb"}, v_alpha{"v_alpha"}, v_depth{"v_depth"}, v_flow{"v_flow"};
  bool flow_in_parts = false;  // v_flow is 0 in much of the picture: worth looking where
};

}  // namespace gflow
