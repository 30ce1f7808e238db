// SPDX-License-Identifier: Apache-2.0
// Motion model "bases": each Gaussian follows a weighted blend of a few rigid motions that all
// share (kernels/shared/motion/bases.h). The motions are stored at keys: basis_shifts [K, B, 3] and
// basis_turns [K, B, 4] (added to the identity quaternion); 0 is no motion. pivots [B, 3] are not
// trained. 13 + B floats per Gaussian. Suits scenes of few rigid objects, above all if one camera
// at a time sees each.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/keys.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// Groups with a row per Gaussian, and the other tables.
std::vector<GroupSpec> bases_groups(int bases);
std::vector<TableSpec> bases_tables(int keys, int bases);

// Sets "pivots" and "basis_logits" of static Gaussians. Pivots are far apart from each other,
// chosen among Gaussians first .. count - 1. Each Gaussian follows the bases whose pivots are near,
// or none.
void place_bases(const MotionShape& shape, HostGroups& groups, size_t first, size_t end);

// Entry in the table of models.
const MotionModel& bases_model();

class BasesMotion : public Motion {
 public:
  // Error for fewer than one key or basis, or too many bases.
  BasesMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return bases_groups(shape_.bases); }
  std::vector<TableSpec> tables() const override { return bases_tables(shape_.keys, shape_.bases); }
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
  // Sets poses_ at a time; returns the keys that it used.
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
      bases_cull_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_int, cl_float, cl_int, In<cl_uint>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>>
      bases_bwd_;
  Kernel<cl_uint, cl_int, KeyWeights, In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>>
      bases_gather_;
  CanonicalRows canonical_rows_;
  Buffer<float> poses_{"basis poses"};        // [B, 7]
  Buffer<float> partials_{"basis partials"};  // [chunks, B, 7]
};

}  // namespace gflow
