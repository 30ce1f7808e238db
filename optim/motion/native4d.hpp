// SPDX-License-Identifier: Apache-2.0
// Motion model "native4d": 4D Gaussians, sliced at a time (RT-4DGS; formulas:
// kernels/shared/motion/native4d.h). Groups: means [N,3], means_t [N,1], quats and quats_r [N,4],
// log_scales [N,4] (x y z t), logit_opacities [N,1]. Each Gaussian moves along a straight line; its
// shape is constant.
#pragma once
#include "optim/motion/models.hpp"

namespace gflow {

// Groups with a row per Gaussian.
std::vector<GroupSpec> native4d_groups();

// Entry in the table of models.
const MotionModel& native4d_model();

class Native4dMotion : public Motion {
 public:
  // cutoff: temporal weight, in [0, 1), at or below which a Gaussian is skipped.
  Native4dMotion(Queue& queue, float cutoff);
  std::vector<GroupSpec> groups() const override { return native4d_groups(); }
  void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows = {}) override;
  bool cull(Queue& queue, const Parameters& parameters, float t, const PinholeCamera& camera,
            ViewRows& rows) override;
  void backward(Queue& queue, Parameters& parameters, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows = {}) override;
  void set_rate_scales(Queue& queue, Parameters& parameters, const PaceRule& rule) override;
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed) override;

 private:
  float cutoff_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>>
      native4d_fwd_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, PinholeCamera, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<float>, Out<cl_uint>, Out<cl_uint>>
      native4d_cull_;
  Kernel<cl_uint, cl_uint, cl_float, cl_int, In<cl_uint>, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<cl_uint>, In<float>, In<float>, In<float>,
         Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>>
      native4d_bwd_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_float, cl_float, cl_float, cl_float, In<cl_uint>, Out<float>,
         Out<float>, In<float>, In<float>, Out<float>, Out<float>>
      native4d_split_;
  Kernel<cl_uint, cl_float, cl_float, cl_float, In<float>, Out<float>> native4d_pace_;
};

}  // namespace gflow
