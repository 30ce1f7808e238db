// SPDX-License-Identifier: Apache-2.0
// Removes Gaussians between training cameras and their near planes (kernels/density/near.cl): no
// training view shows them, but other views would.
#pragma once
#include <vector>

#include "optim/engine/gaussians.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

class NearFade {
 public:
  explicit NearFade(Queue& queue);

  // Limits the opacity of the Gaussians that are nearer than its near plane to one of the cameras
  // at time t (model time), and in its image. All cameras have the same near plane. most_logit: the
  // limit, below what density control removes.
  void run(Queue& queue, Parameters& parameters, Motion& motion, float t,
           const std::vector<PinholeCamera>& cameras, float most_logit);

 private:
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, In<float>, In<float>, In<float>, Out<float>>
      near_fade_;
  Buffer<float> views_{"cameras"};
  GaussiansAt at_;
};

}  // namespace gflow
