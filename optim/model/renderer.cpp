// SPDX-License-Identifier: Apache-2.0
#include "optim/model/renderer.hpp"

#include <algorithm>
#include <cstring>

namespace gflow {
namespace {

bool same(const PinholeCamera& a, const PinholeCamera& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;  // floats and ints, no padding
}

}  // namespace

PinholeCamera pinhole(const Camera& camera, float near_plane) {
  PinholeCamera p{};
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) p.rotation[3 * row + col] = float(camera.viewmat(row, col));
    p.translation[row] = float(camera.viewmat(row, 3));
  }
  p.fx = float(camera.fx);
  p.fy = float(camera.fy);
  p.cx = float(camera.cx);
  p.cy = float(camera.cy);
  p.near_plane = near_plane;
  p.width = camera.width;
  p.height = camera.height;
  return p;
}

const Buffer<cl_uint>& Renderer::with_second_time() const {
  const Splats& splats = engine_.splats();
  return shot_.pose_t2 ? splats.tiles_touched : splats.rows_with_flow();
}

bool Renderer::has_t0() const {
  return shot_.pose_t0 && shot_.time_t0() > -1e-6 && shot_.time_t0() < 1 + 1e-6;
}

Bands Renderer::bands(const Model& model) const {
  return model.color.bands(shot_.sh_degree, skip_.bands);
}

void Renderer::cull(Queue& queue, Model& model, const Shot& shot) {
  // Losses on poses identify Gaussians by row and may compare visible ones with others.
  const bool all = !skip_.culled || shot.all_posed || shot.pose_t2;
  if (!all &&
      model.motion->cull(queue, model.parameters, model.time(shot.time), shot.view.camera, rows_))
    rows_.take_marked(queue, model.parameters);
  else
    rows_.take_all(model.parameters);
}

RowList Renderer::moving_rows() const {
  const RowList all = rows_.list();
  return {std::min(all.count, shot_.view.moving), all.rows};
}

void Renderer::pose(Queue& queue, Model& model, const Shot& shot) {
  shot_ = shot;
  shot_.sh_degree = std::min(shot.sh_degree, model.shape.sh_degree);
  View& view = shot_.view;
  cull(queue, model, shot);
  // Losses on poses compare both times, of static Gaussians too.
  if (skip_.static_pose && shot.flow && !shot.pose_t2 && same(view.camera, view.camera_t2))
    view.moving = rows_.moving();
  const RowList rows = rows_.list();
  model.motion->at(queue, model.parameters, model.time(shot.time), nullptr, t1_, rows);
  engine_.project(queue, view, {shot.flow, shot.depth}, t1_);
  const Buffer<cl_uint>& seen = engine_.splats().tiles_touched;
  if (shot.flow || shot.pose_t2)
    model.motion->at(queue, model.parameters, model.time(shot.time_t2), &with_second_time(), t2_,
                     moving_rows());
  if (has_t0())
    model.motion->at(queue, model.parameters, model.time(shot_.time_t0()), &seen, t0_, rows);
}

void Renderer::forward(Queue& queue, Model& model, const Shot& shot) {
  pose(queue, model, shot);
  model.color.forward(queue, model.parameters, bands(model), shot.view.camera, t1_,
                      engine_.splats().tiles_touched, colors_, rows_.list());
  engine_.draw(queue, shot.background, t1_, shot.flow ? t2_ : t1_, colors_);
}

GaussianGradients& Renderer::backward_to_poses(Queue& queue, const ImageGradients& v) {
  engine_.backward(queue, t1_, shot_.flow ? t2_ : t1_, v, gradients_);
  zero_other_times(queue);
  return gradients_;
}

GaussianGradients& Renderer::begin_gradients(Queue& queue) {
  gradients_.ensure(queue, rows_.count());
  zero_other_times(queue);
  return gradients_;
}

void Renderer::zero_other_times(Queue& queue) {
  GaussianGradients& g = gradients_;
  if (shot_.pose_t2 && !shot_.flow) {
    g.v_means_t2.fill(queue, 0);
    g.v_factors_t2.fill(queue, 0);
  }
  if (has_t0()) {
    g.v_means_t0.ensure(queue, g.v_means.size());
    g.v_factors_t0.ensure(queue, g.v_factors.size());
    g.v_means_t0.fill(queue, 0);
    g.v_factors_t0.fill(queue, 0);
  }
}

void Renderer::backward_to_parameters(Queue& queue, Model& model) {
  Parameters& p = model.parameters;
  GaussianGradients& g = gradients_;
  const Buffer<cl_uint>& seen = engine_.splats().tiles_touched;
  const RowList rows = rows_.list();
  model.color.backward(queue, p, bands(model), shot_.view.camera, t1_, seen, g, rows);
  model.motion->backward(queue, p, model.time(shot_.time), true, seen, g.v_means, g.v_factors,
                         g.v_opacities, rows);
  if (shot_.flow || shot_.pose_t2)
    model.motion->backward(queue, p, model.time(shot_.time_t2), false, with_second_time(),
                           g.v_means_t2, g.v_factors_t2, g.v_opacities, moving_rows());
  if (has_t0())
    model.motion->backward(queue, p, model.time(shot_.time_t0()), false, seen, g.v_means_t0,
                           g.v_factors_t0, g.v_opacities, rows);
}

}  // namespace gflow
