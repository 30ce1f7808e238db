// SPDX-License-Identifier: Apache-2.0
// The engine's inputs and outputs. N Gaussians, M tile intersections, H x W pixels; images are
// planar.
#pragma once
#include <array>

#include "runtime/cl/kernel.hpp"
#include "shared/types.h"

GFLOW_KERNEL_STRUCT(PinholeCamera);

namespace gflow {

// Gaussians at one time, from any motion model. Covariance = L L^T with the factor L, so that all
// models share the engine. Opacity 0: absent at this time.
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

// Gradients of a loss with respect to the arrays above and the colours; undefined for Gaussians
// that were not visible.
struct GaussianGradients {
  Buffer<float> v_means{"v_means"}, v_factors{"v_factors"}, v_opacities{"v_opacities"};
  Buffer<float> v_colors{"v_colors"};                                    // [N, 3]
  Buffer<float> v_means_t2{"v_means_t2"}, v_factors_t2{"v_factors_t2"};  // second time
  Buffer<float> v_means_t0{"v_means_t0"}, v_factors_t0{"v_factors_t0"};  // time before the first
  // [N, 2]; of the images by the projected mean [1/px]. With absgrad (a, a) where
  // sqrt(2) a = sum of |gradient| over pixels.
  Buffer<float> v_means2d{"v_means2d"};

  void ensure(Queue& queue, size_t n) {
    v_means.ensure(queue, 3 * n);
    v_factors.ensure(queue, 9 * n);
    v_opacities.ensure(queue, n);
    v_colors.ensure(queue, 3 * n);
    v_means_t2.ensure(queue, 3 * n);
    v_factors_t2.ensure(queue, 9 * n);
    v_means2d.ensure(queue, 2 * n);
  }
  // Zero for n rows; rows that are not visible stay 0.
  void zero(Queue& queue, size_t n) {
    ensure(queue, n);
    for (Buffer<float>* v :
         {&v_means, &v_factors, &v_opacities, &v_colors, &v_means_t2, &v_factors_t2, &v_means2d})
      v->fill(queue, 0.f);
  }
};

struct Images {
  int width = 0, height = 0;
  Buffer<float> rgb{"rgb"};      // [3, H, W]; background included
  Buffer<float> alpha{"alpha"};  // [H, W]; sum of weights
  Buffer<float> depth{"depth"};  // [H, W]; sum of weight x depth; with Channels::depth
  Buffer<float> flow{"flow"};    // [2, H, W]; sum w f / sum w [px]; 0 where nothing is drawn
  Buffer<float> flow_weight{"flow_weight"};      // [H, W]; with top_k only
  Buffer<float> transmittance{"transmittance"};  // [H, W]; what passes through all splats
  // [H, W] number of entries of the tile's list until the pixel saturates, for the backward pass.
  // With top_k [2, H, W]; the second plane is the number until its flow is complete.
  Buffer<cl_int> ends{"ends"};
  std::array<float, 3> background{};  // behind all splats
};

// Gradients of a loss with respect to the images, in their sizes. depth and flow only with their
// channel.
struct ImageGradients {
  Buffer<float> v_rgb{"v_rgb"}, v_alpha{"v_alpha"}, v_depth{"v_depth"}, v_flow{"v_flow"};
  bool flow_in_parts = false;  // v_flow is 0 in many tiles, which may be skipped

  // Zero, in the sizes of the images; with_flow, with_depth: their channels.
  void zero(Queue& queue, const Images& images, bool with_flow, bool with_depth) {
    const size_t pixels = size_t(images.width) * size_t(images.height);
    const auto start = [&](Buffer<float>& v, size_t size) {
      v.ensure(queue, size);
      if (size > 0) v.fill(queue, 0.f);
    };
    start(v_rgb, 3 * pixels);
    start(v_alpha, pixels);
    start(v_depth, with_depth ? pixels : 0);
    start(v_flow, with_flow ? 2 * pixels : 0);
  }
};

}  // namespace gflow
