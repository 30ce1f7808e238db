// SPDX-License-Identifier: Apache-2.0
// Motion model "keyframes": free paths stored at keys. A Gaussian has a canonical pose, means and
// quats, and is shifted from it by the cubic through key_shifts [K, N, 3], key_turns [K, N, 4]
// (added to the quaternion) and, with shape.key_scales, key_scales [K, N, 3] (added to the
// log_scales) (kernels/shared/motion/shifted.h, keys.hpp). With one key per frame this is the
// per-frame model of Dynamic 3D Gaussians (Luiten et al. 2024), plus a canonical pose that all
// frames train. 13 floats per Gaussian and 7 per key (10 with key_scales); a view touches at most
// four keys per time.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/keys.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// key_shifts, key_turns and, with shape.key_scales, key_scales: a row per key and Gaussian.
std::vector<TableSpec> keyframes_tables(const MotionShape& shape);

// Entry in the table of models.
const MotionModel& keyframes_model();

class KeyframesMotion : public Motion {
 public:
  KeyframesMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return canonical_groups(); }
  std::vector<TableSpec> tables() const override { return keyframes_tables(shape_); }
  void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows = {}) override;
  bool cull(Queue& queue, const Parameters& parameters, float t, const PinholeCamera& camera,
            ViewRows& rows) override;
  void backward(Queue& queue, Parameters& parameters, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows = {}) override;
  void set_rate_scales(Queue& queue, Parameters& parameters, const PaceRule& rule) override;
  void start_key(Queue& queue, Parameters& parameters, int key) override;
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed) override;

 private:
  MotionShape shape_;
  std::string scales_;  // group bound as key_scales; key_shifts if the model has none
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, KeyWeights, In<cl_uint>, In<cl_uint>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>, Out<float>>
      keyframes_fwd_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, PinholeCamera, KeyWeights, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<cl_uint>,
         Out<cl_uint>>
      keyframes_cull_;
  Kernel<cl_uint, cl_uint, cl_float, cl_int, KeyWeights, In<cl_uint>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>>
      keyframes_bwd_;
  Kernel<cl_uint, cl_uint, cl_uint, Out<float>> keyframes_start_;
  CanonicalRows canonical_rows_;
};

}  // namespace gflow
