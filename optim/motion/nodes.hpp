// SPDX-License-Identifier: Apache-2.0
// Motion model "nodes": a few hundred nodes move as a small network of place and time says, and
// every Gaussian follows the nearest ones (kernels/shared/motion/nodes.h; SC-GS, Huang et al.
// 2024). 13 floats per Gaussian, independent of the length of the video; nodes and network are
// shared.
#pragma once
#include "optim/motion/canonical_rows.hpp"
#include "optim/motion/plane_field.hpp"
#include "shared/motion/nodes.h"

namespace gflow {

// "node_places" [nodes, 3] and "node_log_radii" [nodes, 1]; those of the field.
std::vector<TableSpec> nodes_tables(const MotionShape& shape);

// Entry in the table of models.
const MotionModel& nodes_model();

class NodesMotion : public Motion {
 public:
  NodesMotion(Queue& queue, const MotionShape& shape);
  std::vector<GroupSpec> groups() const override { return canonical_groups(); }
  std::vector<TableSpec> tables() const override { return nodes_tables(shape_); }
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
  void rearrange(Queue& queue, Parameters& parameters) override;

 private:
  // Sets columns_, outputs_, poses_ and node_rows_ from the field, which was cut at time t, and
  // with near_ and weights_ the blends_ of the first n Gaussians of a view, the dynamic ones.
  void pose(Queue& queue, const Parameters& parameters);
  void blend(Queue& queue, const Parameters& parameters, size_t n, float t,
             const Buffer<cl_uint>* seen, const RowList& rows);
  // From the gradients of the blends of the first n Gaussians of a view to all that nodes share.
  void backward_to_nodes(Queue& queue, Parameters& parameters, size_t n, const Chunks& parts,
                         const Buffer<cl_uint>& tiles_touched, const RowList& rows);

  MotionShape shape_;
  size_t nodes_, length_, block_;  // length_: of columns_
  float blended_ = -1;             // the time of blends_
  float rigidity_;
  Program program_;
  Kernel<cl_uint, cl_uint, In<float>, In<float>, Out<float>> nodes_columns_;
  Kernel<cl_uint, cl_uint, In<float>, In<float>, Out<cl_uint>> nodes_links_;
  Kernel<cl_uint, cl_uint, cl_int, In<cl_uint>, In<cl_uint>, In<float>, cl_uint, In<float>,
         Out<cl_uint>, Out<float>>
      nodes_near_;
  Kernel<cl_uint, cl_int, HexplaneGrid, In<cl_uint>, In<cl_uint>, In<float>, In<float>, In<cl_uint>,
         In<float>, Out<float>>
      nodes_blend_;
  Kernel<cl_uint, HexplaneGrid, In<float>, In<float>, In<float>, In<float>, Out<float>, Out<float>,
         Out<float>>
      nodes_pose_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>>
      nodes_fwd_;
  Kernel<cl_uint, cl_uint, cl_float, cl_int, In<cl_uint>, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<cl_uint>, In<float>, In<float>, In<float>,
         Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>>
      nodes_bwd_;
  Kernel<cl_uint, cl_uint, cl_uint, HexplaneGrid, In<cl_uint>, In<float>, cl_uint, In<float>,
         In<float>, In<cl_uint>, In<float>, In<cl_uint>, In<float>, Out<float>, Out<float>>
      nodes_sum_;
  Kernel<cl_uint, cl_uint, HexplaneGrid, cl_float, In<float>, In<float>, In<float>, In<float>,
         In<cl_uint>, Out<cl_uint>, Out<float>, Out<float>, Out<float>>
      nodes_gather_;
  Kernel<cl_uint, cl_uint, HexplaneGrid, In<float>, In<float>, In<float>, In<float>, In<float>,
         In<float>, Out<float>, Out<float>, Out<cl_uint>, Out<float>>
      nodes_bwd_network_;
  PlaneField field_;
  CanonicalRows canonical_rows_;
  Buffer<float> columns_{"node columns"}, outputs_{"node outputs"}, poses_{"node poses"};
  Buffer<float> node_rows_{"node rows"}, weights_{"node weights"}, blends_{"blends"};
  Buffer<float> v_blends_{"v_blends"};
  Buffer<float> sums_{"node sums"}, v_outputs_{"v_node_outputs"};
  Buffer<cl_uint> near_{"near nodes"}, links_{"node links"}, used_{"nodes used"};
};

}  // namespace gflow
