// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/hexplane.hpp"

#include "optim/motion/motion_options.hpp"
#include "runtime/cl/chunks.hpp"

namespace gflow {
namespace {

constexpr size_t kGroup = 64;

// Chunks of Gaussians, each with its own copy of the network's gradients.
Chunks network_chunks(const Queue& queue, size_t n) {
  return chunks_of_sums(n, 128, queue.lanes == 1 ? 32 : 16);
}

}  // namespace

HexplaneMotion::HexplaneMotion(Queue& queue, const MotionShape& shape)
    : shape_(shape.hexplane),
      sigmas_(window_sigmas(shape.cutoff)),
      lanes_(size_t(queue.lanes)),
      program_(queue, "motion/hexplane.cl", field_defines(shape.hexplane)),
      hexplane_fwd_(program_, "hexplane_fwd"),
      hexplane_bwd_(program_, "hexplane_bwd"),
      field_(queue, program_, shape.hexplane, shape.duration),
      canonical_rows_(queue) {}

void HexplaneMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                        GaussiansAt& gaussians, const RowList&) {
  gaussians.ensure(queue, p.count);
  field_.cut(queue, p, t);
  const size_t per_item = lanes_ == 1 ? 1 : 256;
  hexplane_fwd_(queue, Range::over((p.count + per_item - 1) / per_item, lanes_ == 1 ? kGroup : 1),
                cl_uint(p.count), cl_uint(p.moving), cl_uint(per_item), t, sigmas_, int(!seen),
                field_.grid(), seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                p["quats"].values, p["log_scales"].values, p["logit_opacities"].values,
                p["planes"].values, field_.lines(), p["network"].values, gaussians.means,
                gaussians.factors, gaussians.opacities);
}

void HexplaneMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                              const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                              const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                              const RowList&) {
  const size_t n = p.count;
  const bool gpu = lanes_ == 1;
  const Chunks chunks = network_chunks(queue, n);
  field_.begin(queue, p, t, p.moving, chunks);
  NetworkBackward& network = field_.network();
  hexplane_bwd_(queue, gpu ? Range::over(n, kGroup) : Range::groups(chunks.count, 1), cl_uint(n),
                cl_uint(p.moving), gpu ? 1u : chunks.length, t, int(first), field_.grid(),
                p["means"].values, p["means_t"].values, p["quats"].values, p["log_scales"].values,
                p["logit_opacities"].values, p["planes"].values, field_.lines(),
                p["network"].values, network.transposed(), tiles_touched, v_means, v_factors,
                v_opacities, p.rows.seen, p["means"].grads, p["means_t"].grads, p["quats"].grads,
                p["log_scales"].grads, p["logit_opacities"].grads, field_.v_features(),
                network.sums(), network.kept());
  field_.finish(queue, p, p.moving, tiles_touched, p["means"].values, p["means"].grads);
}

void HexplaneMotion::regularize(Queue& queue, Parameters& p, const MotionOptions& options) {
  field_.regularize(queue, p, options.hexplane);
}

void HexplaneMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_rows_.set_rate_scales(queue, p, rule);
}

void HexplaneMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                           const SplitRule& rule, uint32_t seed) {
  canonical_rows_.split(queue, p, child, rule, seed);
}

const MotionModel& hexplane_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "hexplane";
    m.is_permanent = true;
    m.numbers = field_numbers();
    m.kept_numbers = kept_field_numbers();
    m.set_numbers = set_field_numbers;
    m.enclose = enclose_in_box;
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<HexplaneMotion>(queue, shape);
    };
    m.groups = [](const MotionShape&) { return canonical_groups(); };
    m.tables = [](const MotionShape& shape) { return field_tables(shape.hexplane); };
    m.set_static = [](const MotionShape& shape, HostGroups& groups, size_t, uint32_t seed) {
      set_field_static(shape.hexplane, groups, seed);
    };
    m.is_static = [](const MotionShape& shape, const HostGroups& groups) {
      return is_field_static(shape.hexplane, groups);
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
