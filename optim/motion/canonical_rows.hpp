// SPDX-License-Identifier: Apache-2.0
// Shared by all models in which a Gaussian has a canonical pose that is shifted over time
// (kernels/shared/motion/shifted.h): parameter groups, rate_scale and split.
#pragma once
#include "optim/motion/motion.hpp"

namespace gflow {

// means [N,3], means_t [N,1], quats [N,4], log_scales [N,4] (x y z t), logit_opacities [N,1].
std::vector<GroupSpec> canonical_groups();

class CanonicalRows {
 public:
  explicit CanonicalRows(Queue& queue);
  // See Motion::set_rate_scales and Motion::split. Children keep path and lifetime.
  void set_rate_scales(Queue& queue, Parameters& parameters, const PaceRule& rule);
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed);

 private:
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, In<cl_uint>, Out<float>, In<float>, Out<float>, Out<float>>
      canonical_split_;
  Kernel<cl_uint, cl_float, cl_float, cl_float, In<float>, Out<float>> canonical_pace_;
};

}  // namespace gflow
