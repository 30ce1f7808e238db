// SPDX-License-Identifier: Apache-2.0
// Motion model "hexplane": all Gaussians have one canonical pose, and a field shifts, rotates and
// resizes them over time. The field is a set of feature planes over x y z t and a small network
// (kernels/shared/motion/hexplane.h; HexPlane, Cao & Johnson 2023; 4DGaussians, Wu et al. 2024;
// DreamGaussian4D, Ren et al. 2023). 13 floats per Gaussian, independent of the length of the
// video; planes and network are shared.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/models.hpp"
#include "optim/motion/network.hpp"
#include "shared/motion/hexplane.h"

GFLOW_KERNEL_STRUCT(HexplaneGrid);

namespace gflow {

HexplaneGrid grid_of(const HexplaneShape& shape);

// "planes" [rows, channels] and "network" [weights, 1].
std::vector<TableSpec> hexplane_tables(const HexplaneShape& shape);

// Initialises both so that nothing moves: time planes 1, space planes uniform in [0.1, 0.5] as in
// 4DGaussians, the network as first_weights().
void set_hexplane_static(const HexplaneShape& shape, HostGroups& groups, uint32_t seed);

// Whether the last layer is 0.
bool is_hexplane_static(const HexplaneShape& shape, const HostGroups& groups);

// Sets the box of the planes to the range of xyz [n, 3], without 1 % of the points at each end of
// each axis, enlarged by the factor 1 + slack.
void set_box(HexplaneShape& shape, const std::vector<float>& xyz, float slack);

// Entry in the table of models.
const MotionModel& hexplane_model();

class HexplaneMotion : public Motion {
 public:
  // Error if a number of the shape is out of range.
  HexplaneMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return canonical_groups(); }
  std::vector<TableSpec> tables() const override { return hexplane_tables(shape_); }
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
  // Interpolates the time planes at t into lines_; returns the row before t and the weight of the
  // next row.
  struct TimePlace {
    int row;
    float share;
  };
  TimePlace cut(Queue& queue, const Parameters& parameters, float t);

  HexplaneShape shape_;
  HexplaneGrid grid_;
  float duration_, sigmas_;
  size_t lanes_, cells_;  // cells_: cells of all planes at one time
  Program program_;
  Kernel<HexplaneGrid, cl_int, cl_float, In<float>, Out<float>> hexplane_cut_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, HexplaneGrid, In<cl_uint>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>,
         Out<float>, Out<float>>
      hexplane_fwd_;
  Kernel<cl_uint, cl_uint, cl_float, cl_int, HexplaneGrid, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>, Out<float>>
      hexplane_bwd_;
  Kernel<cl_uint, cl_uint, HexplaneGrid, In<cl_uint>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>>
      hexplane_bwd_planes_;
  Kernel<cl_uint, In<cl_uint>, In<float>, Out<float>> hexplane_bwd_means_;
  Kernel<cl_uint, HexplaneGrid, cl_int, cl_float, In<float>, Out<cl_uint>, Out<float>>
      hexplane_sum_planes_;
  Kernel<HexplaneGrid, cl_float, cl_float, cl_float, In<float>, Out<cl_uint>, Out<float>>
      hexplane_regularize_;
  NetworkBackward network_;
  CanonicalRows canonical_rows_;
  Buffer<float> lines_{"hexplane lines"}, v_cuts_{"v_slices"};
  Buffer<float> v_features_{"v_features"}, v_places_{"v_places"};
};

}  // namespace gflow
