// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/project.hpp"

#include <algorithm>

#include "optim/engine/raster.hpp"

namespace gflow {
namespace {

cl_uint moving_of(const View& view, size_t n) { return cl_uint(std::min(view.moving, n)); }

}  // namespace

Project::Project(Queue& queue, const EngineSettings& settings, Channels channels)
    : program_(raster_program(queue, settings, channels)),
      project_fwd_(program_, "project_fwd"),
      transport_fwd_(program_, "transport_fwd"),
      project_bwd_(program_, "project_bwd") {}

void Project::forward(Queue& queue, const View& view, const GaussiansAt& at_t1, Splats& splats) {
  const size_t n = at_t1.opacities.size();
  splats.count = n;
  splats.records.ensure(queue, SPLAT_FLOATS * n);
  splats.tile_boxes.ensure(queue, 4 * n);
  splats.tiles_touched.ensure(queue, n);
  splats.depth_keys.ensure(queue, n);
  splats.chosen = view.flow_tiles;
  splats.flow_touched.ensure(queue, splats.chosen ? n : 1);
  project_fwd_(queue, Range::over(n), cl_uint(n), view.camera, int(splats.chosen), at_t1.means,
               at_t1.factors, at_t1.opacities, splats.chosen ? *view.flow_tiles : at_t1.opacities,
               splats.records, splats.tile_boxes, splats.tiles_touched, splats.flow_touched,
               splats.depth_keys);
}

void Project::complete(Queue& queue, const View& view, const GaussiansAt& at_t1,
                       const GaussiansAt& at_t2, const Buffer<float>& colors, Splats& splats) {
  const size_t n = splats.count;
  transport_fwd_(queue, Range::over(n), cl_uint(n), moving_of(view, n), view.camera, view.camera_t2,
                 at_t1.means, at_t1.factors, colors, at_t2.means, at_t2.factors,
                 splats.tiles_touched, splats.rows_with_flow(), splats.records);
}

void Project::backward(Queue& queue, const View& view, const GaussiansAt& at_t1,
                       const GaussiansAt& at_t2, const Splats& splats, const Buffer<float>& moments,
                       GaussianGradients& gradients) {
  const size_t n = splats.count;
  gradients.ensure(queue, n);
  project_bwd_(queue, Range::over(n), cl_uint(n), moving_of(view, n), view.camera, view.camera_t2,
               at_t1.means, at_t1.factors, at_t1.opacities, at_t2.means, at_t2.factors,
               splats.records, splats.tiles_touched, moments, gradients.v_means,
               gradients.v_factors, gradients.v_opacities, gradients.v_colors, gradients.v_means_t2,
               gradients.v_factors_t2, gradients.v_means2d);
}

}  // namespace gflow
