// SPDX-License-Identifier: Apache-2.0
// Finds Gaussians that no view shows, because others are in front of them
// (kernels/density/hidden.cl).
#pragma once
#include "optim/engine/project.hpp"
#include "optim/motion/view_rows.hpp"

namespace gflow {

class Hidden {
 public:
  explicit Hidden(Queue& queue);

  // No view has been seen yet. all_views: all views will be, so a Gaussian outside all of them is
  // hidden; else it stays.
  void begin(Queue& queue, const Parameters& parameters, bool all_views);
  // A view of these rows, after a backward pass with a gradient of 1 to every pixel's colour.
  void see(Queue& queue, const Parameters& parameters, const RowList& rows,
           const PinholeCamera& camera, const Splats& splats, const GaussianGradients& v);
  // Lowers logit_opacities to at most `limit` where no view showed the share `least` of a Gaussian.
  void fade(Queue& queue, Parameters& parameters, float least, float limit);

 private:
  Program program_;
  Kernel<cl_uint, cl_float, cl_float, In<cl_uint>, In<cl_uint>, In<float>, In<float>, Out<float>>
      hidden_see_;
  Kernel<cl_uint, cl_float, cl_float, In<float>, Out<float>> hidden_fade_;
  Buffer<float> shown_{"shown shares"};
};

}  // namespace gflow
