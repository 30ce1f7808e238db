// SPDX-License-Identifier: Apache-2.0
// Gradients of a loss by the cameras of a view, from those by its Gaussians
// (kernels/shared/camera_gradient.h).
#pragma once
#include <array>
#include <vector>

#include "optim/engine/engine.hpp"
#include "shared/camera_gradient.h"

namespace gflow {

// Rotation x y z [1 / rad], translation x y z [1 / scene unit], log fx, log fy.
using CameraSums = std::array<double, CAMERA_GRADIENT_SIZE>;

class CameraGradients {
 public:
  explicit CameraGradients(Queue& queue);

  // Starts the sums of a view after Engine::backward(): one for its camera and, with flow, one for
  // its camera at t2. gradients: as backward() has set them, without what others add.
  void start(Queue& queue, const View& view, bool flow, const Splats& splats,
             const GaussiansAt& at_t1, const GaussiansAt& at_t2,
             const GaussianGradients& gradients);
  // The sums of all views started since the last call, in their order. Waits.
  std::vector<CameraSums> take(Queue& queue);

 private:
  struct Sum {
    size_t items = 0;
    Buffer<float> values{"camera gradient"};  // [8, items]
  };
  void add(Queue& queue, const PinholeCamera& camera, size_t n, const GaussiansAt& gaussians,
           const Buffer<cl_uint>& shown, const Buffer<float>& v_means,
           const Buffer<float>& v_factors);

  Program program_;
  Kernel<cl_uint, cl_uint, PinholeCamera, In<float>, In<float>, In<cl_uint>, In<float>, In<float>,
         Out<float>>
      camera_gradient_sums_;
  std::vector<Sum> sums_;  // the first `started_` are in use
  size_t started_ = 0;
};

}  // namespace gflow
