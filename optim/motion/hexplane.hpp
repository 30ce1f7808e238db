// SPDX-License-Identifier: Apache-2.0
// Motion model "hexplane": all Gaussians have one canonical pose, and a field shifts, rotates and
// resizes them over time (plane_field.hpp; 4DGaussians, Wu et al. 2024; DreamGaussian4D, Ren et al.
// 2023). 13 floats per Gaussian, independent of the length of the video; planes and network are
// shared.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/plane_field.hpp"

namespace gflow {

// Entry in the table of models.
const MotionModel& hexplane_model();

class HexplaneMotion : public Motion {
 public:
  // Error if a number of the shape is out of range.
  HexplaneMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return canonical_groups(); }
  std::vector<TableSpec> tables() const override { return field_tables(shape_); }
  void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows = {}) override;
  void backward(Queue& queue, Parameters& parameters, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows = {}) override;
  void regularize(Queue& queue, Parameters& parameters, const MotionOptions& options) override;
  void set_rate_scales(Queue& queue, Parameters& parameters, const PaceRule& rule) override;
  void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
             const SplitRule& rule, uint32_t seed) override;

 private:
  HexplaneShape shape_;
  float sigmas_;
  size_t lanes_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_float, cl_float, cl_int, HexplaneGrid, In<cl_uint>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>, Out<float>>
      hexplane_fwd_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_float, cl_int, HexplaneGrid, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>, Out<float>>
      hexplane_bwd_;
  PlaneField field_;
  CanonicalRows canonical_rows_;
};

}  // namespace gflow
