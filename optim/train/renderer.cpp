// SPDX-License-Identifier: Apache-2.0
#include "optim/train/renderer.hpp"

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
  return shot_.motion_loss ? splats.tiles_touched : splats.rows_with_flow();
}

bool Renderer::bends() const {
  return shot_.motion_loss && shot_.motion_loss->weights().acceleration > 0 && time_t0() > -1e-6 &&
         time_t0() < 1 + 1e-6;
}

Bands Renderer::bands(const Model& model) const {
  return model.color.bands(shot_.sh_degree, skip_.bands);
}

void Renderer::forward(Queue& queue, Model& model, const Shot& shot) {
  shot_ = shot;
  shot_.sh_degree = std::min(shot.sh_degree, model.shape.sh_degree);
  View& view = shot_.view;
  // Motion losses compare poses at both times, of those at rest too.
  if (skip_.still && shot.flow && !shot.motion_loss && same(view.camera, view.camera_t2))
    view.moving = model.parameters.moving;
  const float t1 = model.time(shot.time);
  if (skip_.outside && !shot.all_posed)
    model.motion->seen_at(queue, model.parameters, t1, view.camera, t1_);
  else
    model.motion->at(queue, model.parameters, t1, nullptr, t1_);
  engine_.project(queue, view, {shot.flow, shot.depth}, t1_);
  const Buffer<cl_uint>& seen = engine_.splats().tiles_touched;
  if (shot.flow || shot.motion_loss)
    model.motion->at(queue, model.parameters, model.time(shot.time_t2), &with_second_time(), t2_,
                     view.moving);
  if (bends()) model.motion->at(queue, model.parameters, model.time(time_t0()), &seen, t0_);
  model.color.forward(queue, model.parameters, bands(model), shot.view.camera, t1_, seen, colors_);
  engine_.draw(queue, shot.background, t1_, shot.flow ? t2_ : t1_, colors_);
}

void Renderer::backward(Queue& queue, Model& model, const ImageGradients& v) {
  Parameters& p = model.parameters;
  GaussianGradients& g = gradients_;
  engine_.backward(queue, t1_, shot_.flow ? t2_ : t1_, v, g);
  const Buffer<cl_uint>& seen = engine_.splats().tiles_touched;
  if (shot_.motion_loss && !shot_.flow) {
    g.v_means_t2.fill(queue, 0);
    g.v_factors_t2.fill(queue, 0);
  }
  if (shot_.motion_loss) shot_.motion_loss->run(queue, seen, bends() ? &t0_ : nullptr, t1_, t2_, g);
  model.color.backward(queue, p, bands(model), shot_.view.camera, t1_, seen, g);
  model.motion->backward(queue, p, model.time(shot_.time), true, seen, g.v_means, g.v_factors,
                         g.v_opacities);
  if (shot_.flow || shot_.motion_loss)
    model.motion->backward(queue, p, model.time(shot_.time_t2), false, with_second_time(),
                           g.v_means_t2, g.v_factors_t2, g.v_opacities, shot_.view.moving);
  if (bends())
    model.motion->backward(queue, p, model.time(time_t0()), false, seen, g.v_means_t0,
                           g.v_factors_t0, g.v_opacities);
}

}  // namespace gflow
