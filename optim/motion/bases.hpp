// SPDX-License-Identifier: Apache-2.0
// Gaussians that follow a few rigid motions shared by all, held at keys, by weights of their own
// (kernels/shared/bases.h). Tables: basis_shifts [K, B, 3] and basis_turns [K, B, 4] (added to the
// quaternion 1), 0 being no motion; pivots [B, 3], which are not trained. 13 + B floats a Gaussian.
// For few things that move rigidly, above all where each is seen by one camera at a time.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/keys.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// The arrays with a row a Gaussian, and the others.
std::vector<GroupSpec> bases_groups(int bases);
std::vector<TableSpec> bases_tables(int keys, int bases);

// Sets "pivots" and "basis_logits" of Gaussians at rest: pivots far apart from each other among
// Gaussians first .. count - 1, and each Gaussian following those near it, or none.
void place_bases(const MotionShape& shape, HostGroups& groups, size_t first);

// Its entry in the table of models.
const MotionModel& bases_model();

class BasesMotion : public Motion {
 public:
  // Error for less than one key or basis, or too many bases.
  BasesMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return bases_groups(shape_.bases); }
  std::vector<TableSpec> tables() const override { return bases_tables(shape_.keys, shape_.bases); }
  void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows = {}) override;
  bool look(Queue& queue, const Parameters& parameters, float t, const PinholeCamera& camera,
            ViewRows& rows) override;
  void backward(Queue& queue, Parameters& parameters, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows = {}) override;
  void set_pace(Queue& queue, Parameters& parameters, const PaceRule& rule) override;
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed) override;

 private:
  // Fills poses_ for a time; returns its keys.
  KeyWeights pose(Queue& queue, const Parameters& parameters, float t);

  MotionShape shape_;
  Program program_;
  Kernel<cl_int, KeyWeights, In<float>, In<float>, Out<float>> bases_pose_;
  Kernel<cl_uint, cl_uint, cl_int, cl_float, cl_float, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>,
         Out<float>, Out<float>>
      bases_fwd_;
  Kernel<cl_uint, cl_uint, cl_int, cl_float, cl_float, PinholeCamera, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<cl_uint>,
         Out<cl_uint>>
      bases_look_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_int, cl_float, cl_int, In<cl_uint>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>>
      bases_bwd_;
  Kernel<cl_uint, cl_int, KeyWeights, In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>>
      bases_gather_;
  CanonicalRows still_rows_;
  Buffer<float> poses_{"basis poses"};        // [B, 7]
  Buffer<float> partials_{"basis partials"};  // [chunks, B, 7]
};

}  // namespace gflow
