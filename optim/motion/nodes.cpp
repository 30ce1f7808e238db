// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/nodes.hpp"

#include <algorithm>

#include "optim/motion/motion_options.hpp"
#include "optim/motion/node_places.hpp"

namespace gflow {
namespace {

constexpr size_t kNodesGroup = 64;
constexpr size_t kBlend = 8;  // floats per Gaussian, as BLEND in nodes.cl

size_t count_of(const MotionShape& shape) { return size_t(shape.own_numbers().whole("count")); }
// Chunks of Gaussians, each with its own sums of all nodes.
Chunks sum_chunks(const Queue& queue, size_t n) {
  return chunks_of_sums(n, 64, queue.lanes == 1 ? 1024 : 64);
}
// Chunks of nodes, each with its own sum of the network's gradients: whole blocks of a CPU.
Chunks node_chunks(size_t nodes) {
  Chunks chunks = chunks_of_sums(nodes, 64, 8);
  chunks.length = (chunks.length + 31) / 32 * 32;
  chunks.count = cl_uint((nodes + chunks.length - 1) / chunks.length);
  return chunks;
}
// Entries of a view that follow nodes: dynamic rows come first, and every row is listed.
size_t followers(const Parameters& p, const RowList& rows) {
  return std::min(rows.count_of(p), p.moving);
}

}  // namespace

std::vector<TableSpec> nodes_tables(const MotionShape& shape) {
  TableSpec nodes;
  nodes.groups = {{"node_places", 3, Quantity::position, 0, true},
                  {"node_log_radii", 1, Quantity::scale, 0, true}};
  nodes.rows = count_of(shape);
  std::vector<TableSpec> tables = field_tables(shape.hexplane);
  tables.insert(tables.begin(), nodes);
  return tables;
}

NodesMotion::NodesMotion(Queue& queue, const MotionShape& shape)
    : shape_(shape),
      nodes_(count_of(shape)),
      length_((nodes_ + NODE_GROUP - 1) / NODE_GROUP * NODE_GROUP),
      block_(queue.lanes == 1 ? 1 : 32),
      rigidity_(shape.own_numbers().real("rigidity")),
      program_(queue, "motion/nodes.cl", field_defines(shape.hexplane)),
      nodes_columns_(program_, "nodes_columns"),
      nodes_links_(program_, "nodes_links"),
      nodes_near_(program_, "nodes_near"),
      nodes_blend_(program_, "nodes_blend"),
      nodes_pose_(program_, "nodes_pose"),
      nodes_fwd_(program_, "nodes_fwd"),
      nodes_bwd_(program_, "nodes_bwd"),
      nodes_sum_(program_, "nodes_sum"),
      nodes_gather_(program_, "nodes_gather"),
      nodes_bwd_network_(program_, "nodes_bwd_network"),
      field_(queue, program_, shape.hexplane, shape.duration),
      canonical_rows_(queue) {}

void NodesMotion::pose(Queue& queue, const Parameters& p) {
  columns_.ensure(queue, 4 * length_ + 6 * node_boxes(cl_uint(length_)));
  outputs_.ensure(queue, nodes_ * NETWORK_OUTPUTS);
  poses_.ensure(queue, nodes_ * 7);
  node_rows_.ensure(queue, nodes_ * NODE_ROW);
  nodes_columns_(queue, Range::over(length_), cl_uint(nodes_), cl_uint(length_),
                 p["node_places"].values, p["node_log_radii"].values, columns_);
  nodes_pose_(queue, Range::over((nodes_ + block_ - 1) / block_, block_ == 1 ? kNodesGroup : 1),
              cl_uint(nodes_), field_.grid(), p["node_places"].values, p["planes"].values,
              field_.lines(), p["network"].values, outputs_, poses_, node_rows_);
}

void NodesMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                     GaussiansAt& gaussians, const RowList& rows) {
  const size_t n = rows.count_of(p), moving = followers(p, rows);
  gaussians.ensure(queue, n);
  blends_.ensure(queue, moving * kBlend);
  if (moving > 0) {
    field_.cut(queue, p, t);
    pose(queue, p);
    near_.ensure(queue, moving * NODE_NEIGHBOURS);
    weights_.ensure(queue, moving * NODE_NEIGHBOURS);
    nodes_near_(queue, Range::over(moving), cl_uint(moving), cl_uint(nodes_), int(!seen),
                rows.buffer(), seen ? *seen : p.rows.seen, p["means"].values, cl_uint(length_),
                columns_, near_, weights_);
    blend(queue, p, moving, t, seen, rows);
  }
  nodes_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, window_sigmas(shape_.cutoff),
             int(!seen), rows.buffer(), seen ? *seen : p.rows.seen, p["means"].values,
             p["means_t"].values, p["quats"].values, p["log_scales"].values,
             p["logit_opacities"].values, blends_, gaussians.means, gaussians.factors,
             gaussians.opacities);
}

void NodesMotion::blend(Queue& queue, const Parameters& p, size_t n, float t,
                        const Buffer<cl_uint>* seen, const RowList& rows) {
  nodes_blend_(queue, Range::over(n), cl_uint(n), int(!seen), field_.grid(), rows.buffer(),
               seen ? *seen : p.rows.seen, p["means"].values, node_rows_, near_, weights_, blends_);
  blended_ = t;
}

void NodesMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                           const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                           const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                           const RowList& rows) {
  const size_t n = rows.count_of(p), moving = followers(p, rows);
  if (near_.size() < moving * NODE_NEIGHBOURS)
    throw Error("nodes: backward() needs at() before it");
  const Chunks parts = node_chunks(nodes_);
  if (moving > 0) field_.begin(queue, p, t, nodes_, parts);
  if (moving > 0 && blended_ != t) {  // at() was called for a second time since
    pose(queue, p);
    blend(queue, p, moving, t, &tiles_touched, rows);
  }
  v_blends_.ensure(queue, moving * kBlend);
  nodes_bwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, int(first), rows.buffer(),
             p["means"].values, p["means_t"].values, p["quats"].values, p["log_scales"].values,
             p["logit_opacities"].values, blends_, tiles_touched, v_means, v_factors, v_opacities,
             p.rows.seen, p["means"].grads, p["means_t"].grads, p["quats"].grads,
             p["log_scales"].grads, p["logit_opacities"].grads, v_blends_);
  if (moving > 0) backward_to_nodes(queue, p, moving, parts, tiles_touched, rows);
}

void NodesMotion::backward_to_nodes(Queue& queue, Parameters& p, size_t n, const Chunks& parts,
                                    const Buffer<cl_uint>& tiles_touched, const RowList& rows) {
  const cl_uint nodes = cl_uint(nodes_), length = cl_uint(length_);
  const Chunks chunks = sum_chunks(queue, n);
  sums_.ensure(queue, chunks.count * nodes_ * NODE_SUMS);
  nodes_sum_(queue, Range::groups(chunks.count, 1), cl_uint(n), chunks.length, nodes, field_.grid(),
             rows.buffer(), p["means"].values, length, columns_, node_rows_, near_, weights_,
             tiles_touched, v_blends_, p["means"].grads, sums_);
  links_.ensure(queue, nodes_ * NODE_NEIGHBOURS);
  v_outputs_.ensure(queue, nodes_ * NETWORK_OUTPUTS);
  nodes_links_(queue, Range::over(nodes_), nodes, length, p["node_places"].values, columns_,
               links_);
  nodes_gather_(queue, Range::over(nodes_), chunks.count, nodes, field_.grid(), rigidity_, sums_,
                outputs_, poses_, p["node_places"].values, links_, p.more[0].rows.seen,
                p["node_places"].grads, p["node_log_radii"].grads, v_outputs_);
  p.more[0].active = {0, nodes_};
  used_.ensure(queue, nodes_);
  const bool gpu = block_ == 1;
  NetworkBackward& network = field_.network();
  nodes_bwd_network_(queue, gpu ? Range::groups(nodes_, 1) : Range::groups(parts.count, 1), nodes,
                     gpu ? 1u : parts.length, field_.grid(), p["node_places"].values,
                     p["planes"].values, field_.lines(), p["network"].values, network.transposed(),
                     v_outputs_, network.sums(), network.kept(), used_, field_.v_features());
  field_.finish(queue, p, nodes_, used_, p["node_places"].values, p["node_places"].grads);
}

void NodesMotion::regularize(Queue& queue, Parameters& p, const MotionOptions& options) {
  field_.regularize(queue, p, options.hexplane);
}

void NodesMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_rows_.set_rate_scales(queue, p, rule);
}

void NodesMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                        const SplitRule& rule, uint32_t seed) {
  canonical_rows_.split(queue, p, child, rule, seed);
}

// All nodes take part in every step, so rows differ in values and moments only.
void NodesMotion::rearrange(Queue& queue, Parameters& p) {
  if (p.moving == 0) return;
  Table& table = p.more[0];
  ParameterGroup &places = p["node_places"], &log_radii = p["node_log_radii"];
  NodePlaces nodes{places.values.read(queue), log_radii.values.read(queue)};
  const std::vector<size_t> from =
      relieve_nodes(p["means"].values.read_range(queue, 0, 3 * p.moving), nodes);
  for (ParameterGroup& group : table.groups) {
    for (Buffer<float>* moments : {&group.exp_avg, &group.exp_avg_sq}) {
      if (moments->size() == 0) continue;
      const std::vector<float> old = moments->read(queue);
      std::vector<float> moved(old.size());
      for (size_t k = 0; k < nodes_; ++k)
        std::copy_n(&old[group.width * from[k]], group.width, &moved[group.width * k]);
      moments->write(queue, moved);
    }
  }
  places.values.write(queue, nodes.places);
  log_radii.values.write(queue, nodes.log_radii);
}

const MotionModel& nodes_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "nodes";
    m.own = {{"count", 512, "number of nodes; thousands are slow", between(NODE_NEIGHBOURS, 4096)},
             {"rigidity", 0.001f,
              "weight of the squared change of the distances between neighbours, relative to them",
              at_least(0)}};
    m.is_permanent = true;
    m.numbers = field_numbers();
    m.kept_numbers = kept_field_numbers();
    m.set_numbers = set_field_numbers;
    m.enclose = enclose_in_box;
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<NodesMotion>(queue, shape);
    };
    m.groups = [](const MotionShape&) { return canonical_groups(); };
    m.tables = nodes_tables;
    m.set_static = [](const MotionShape& shape, HostGroups& groups, size_t, uint32_t seed) {
      set_field_static(shape.hexplane, groups, seed);
    };
    m.place = place_nodes;
    m.is_static = [](const MotionShape& shape, const HostGroups& groups) {
      return is_field_static(shape.hexplane, groups);
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
