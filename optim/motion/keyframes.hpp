// SPDX-License-Identifier: Apache-2.0
// Gaussians on free paths, held at keys: each rests at means, quats and is shifted from there by
// the cubic through key_shifts [K, N, 3], key_turns [K, N, 4] (added to the quaternion) and, where
// shape.key_scales says so, key_scales [K, N, 3] (added to the log_scales)
// (kernels/shared/shifted.h, keys.hpp). With a key a frame this is the per-frame model of Dynamic
// 3D Gaussians (Luiten et al. 2024), beside the place where it rests, which all frames train. 13
// floats a Gaussian and 7 a key; a step touches two to five keys only.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/keys.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// key_shifts, key_turns and perhaps key_scales, a row a key and Gaussian.
std::vector<TableSpec> keyframes_tables(const MotionShape& shape);

// Its entry in the table of models.
const MotionModel& keyframes_model();

class KeyframesMotion : public Motion {
 public:
  KeyframesMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return canonical_groups(); }
  std::vector<TableSpec> tables() const override { return keyframes_tables(shape_); }
  void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows = {}) override;
  bool look(Queue& queue, const Parameters& parameters, float t, const PinholeCamera& camera,
            ViewRows& rows) override;
  void backward(Queue& queue, Parameters& parameters, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows = {}) override;
  void set_pace(Queue& queue, Parameters& parameters, const PaceRule& rule) override;
  void start_key(Queue& queue, Parameters& parameters, int key) override;
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed) override;

 private:
  MotionShape shape_;
  std::string scales_;  // the group that kernels take as key_scales: another where there is none
  Program program_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, KeyWeights, In<cl_uint>, In<cl_uint>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>, Out<float>>
      keyframes_fwd_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, PinholeCamera, KeyWeights, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<cl_uint>,
         Out<cl_uint>>
      keyframes_look_;
  Kernel<cl_uint, cl_uint, cl_float, cl_int, KeyWeights, In<cl_uint>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>>
      keyframes_bwd_;
  Kernel<cl_uint, cl_uint, cl_uint, Out<float>> keyframes_start_;
  CanonicalRows still_rows_;
};

}  // namespace gflow
