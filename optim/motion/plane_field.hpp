// SPDX-License-Identifier: Apache-2.0
// The deformation field that the models hexplane and nodes read: planes of features over x y z t
// and a small network (kernels/shared/motion/hexplane.h; HexPlane, Cao & Johnson 2023). Its tables
// are the last two of a model.
#pragma once
#include "optim/motion/models.hpp"
#include "optim/motion/network.hpp"
#include "shared/motion/hexplane.h"

GFLOW_KERNEL_STRUCT(HexplaneGrid);
GFLOW_KERNEL_STRUCT(TimeRows);

namespace gflow {

HexplaneGrid grid_of(const HexplaneShape& shape);
// What kernels/motion/hexplane_planes.cl and network.cl need.
Defines field_defines(const HexplaneShape& shape);

// "planes" [rows, channels] and "network" [weights, 1]. Error if a number is out of range.
std::vector<TableSpec> field_tables(const HexplaneShape& shape);

// Initialises both so that nothing moves: time planes 1, space planes uniform in [0.1, 0.5] as in
// 4DGaussians, the network as first_weights().
void set_field_static(const HexplaneShape& shape, HostGroups& groups, uint32_t seed);

// Whether the last layer is 0.
bool is_field_static(const HexplaneShape& shape, const HostGroups& groups);

// Sets the box of the planes to the range of xyz [n, 3], without 1 % of the points at each end of
// each axis, enlarged by the factor 1 + slack, and no side shorter than a tenth of the longest.
void set_box(HexplaneShape& shape, const std::vector<float>& xyz, float slack);

// MotionModel::numbers and kept_numbers of the field, and how they are set.
std::vector<ShapeNumber> field_numbers();
std::vector<ShapeNumber> kept_field_numbers();
void set_field_numbers(MotionShape& shape, const MotionOptions& options, int time_steps);
void enclose_in_box(MotionShape& shape, const std::vector<float>& means,
                    const MotionOptions& options);

// The field at places of a model: its own kernel reads lines() and the parameters, and gives
// gradients of features and outputs back.
class PlaneField {
 public:
  // program: of the model, with hexplane_planes.cl and network.cl.
  PlaneField(Queue& queue, Program& program, const HexplaneShape& shape, float duration);

  const HexplaneGrid& grid() const { return grid_; }
  // Interpolates the time planes at t into lines().
  void cut(Queue& queue, const Parameters& parameters, float t);
  const Buffer<float>& lines() const { return lines_; }

  // Backward pass at time t for `n` places, in `chunks` of the model's kernel, which fills
  // v_features() and what NetworkBackward needs.
  void begin(Queue& queue, const Parameters& parameters, float t, size_t n, const Chunks& chunks);
  Buffer<float>& v_features() { return v_features_; }  // [n, features]
  NetworkBackward& network() { return network_; }
  // Sets or adds the gradients of planes and network, and adds those of the places. used [n]:
  // whether a place took part.
  void finish(Queue& queue, Parameters& parameters, size_t n, const Buffer<cl_uint>& used,
              const Buffer<float>& places, Buffer<float>& v_places);

  // Adds the gradients of the regularisers of the planes.
  void regularize(Queue& queue, Parameters& parameters, const HexplaneOptions& rule);

 private:
  HexplaneShape shape_;
  HexplaneGrid grid_;
  float duration_;
  size_t lanes_, cells_;  // cells_: cells of all planes at one time
  TimeRows time_{};
  Kernel<HexplaneGrid, TimeRows, In<float>, Out<float>> hexplane_cut_;
  Kernel<cl_uint, cl_uint, HexplaneGrid, In<cl_uint>, In<float>, In<float>, In<float>, In<float>,
         Out<float>, Out<float>>
      hexplane_bwd_planes_;
  Kernel<cl_uint, In<cl_uint>, In<float>, Out<float>> hexplane_bwd_means_;
  Kernel<cl_uint, HexplaneGrid, TimeRows, In<float>, Out<cl_uint>, Out<float>> hexplane_sum_planes_;
  Kernel<HexplaneGrid, cl_float, cl_float, cl_float, In<float>, Out<cl_uint>, Out<float>>
      hexplane_regularize_;
  NetworkBackward network_;
  Buffer<float> lines_{"hexplane lines"}, v_cuts_{"v_slices"};
  Buffer<float> v_features_{"v_features"}, v_places_{"v_places"};
};

}  // namespace gflow
