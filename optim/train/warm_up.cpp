// SPDX-License-Identifier: Apache-2.0
#include "optim/train/warm_up.hpp"

#include "optim/engine/splat.hpp"
#include "optim/init/init.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/loss/image_loss.hpp"
#include "optim/objectives/depth_objective.hpp"
#include "optim/objectives/image_objective.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {
namespace {

template <class T>
Buffer<T> zeros(Queue& queue, size_t n) {
  Buffer<T> buffer(queue, n, "zeros");
  buffer.fill(queue, T(0));
  return buffer;
}

// Inputs and outputs of rendering, for one tile and one Gaussian of opacity 0.
struct WarmUpImage {
  explicit WarmUpImage(Queue& queue) {
    const size_t pixels = TILE * TILE;
    PinholeCamera& camera = view.camera;
    for (const int diagonal : {0, 4, 8}) camera.rotation[diagonal] = 1;
    camera.fx = camera.fy = camera.near_plane = 1;
    camera.width = camera.height = images.width = images.height = TILE;
    view.camera_t2 = camera;
    gaussians = {zeros<float>(queue, 3), zeros<float>(queue, 9), zeros<float>(queue, 1)};
    tiles.x = tiles.y = 1;
    tiles.slot_offsets = zeros<cl_uint>(queue, 2);
    tiles.tile_offsets = zeros<cl_uint>(queue, 2);
    tiles.isect_ids.ensure(queue, 0);
    tiles.isect_slots.ensure(queue, 0);
    tiles.masks.ensure(queue, 0);
    v.v_rgb = zeros<float>(queue, 3 * pixels);
    v.v_alpha = zeros<float>(queue, pixels);
    v.v_depth = zeros<float>(queue, pixels);
    v.v_flow = zeros<float>(queue, 2 * pixels);
    gradients.zero(queue, 1);
  }
  View view{};
  GaussiansAt gaussians;
  Splats splats;
  Tiles tiles;
  Images images;
  ImageGradients v;
  GaussianGradients gradients;
};

void draw_and_return(Queue& queue, const EngineSettings& settings, Channels channels,
                     WarmUpImage& p) {
  Project project(queue, settings, channels);
  Splatting splatting(queue, settings, channels);
  Buffer<float> partials, moments;
  project.forward(queue, p.view, p.gaussians, p.splats);
  project.complete(queue, p.view, p.gaussians, p.gaussians, zeros<float>(queue, 3), p.splats);
  splatting.forward(queue, {}, p.splats, p.tiles, p.images);
  splatting.backward(queue, p.splats, p.tiles, p.images, p.v, partials);
  splatting.gather(queue, p.splats, p.tiles, partials, moments);
  project.backward(queue, p.view, p.gaussians, p.gaussians, p.splats, moments, p.gradients);
  queue.finish();
}

void compare(Queue& queue, const TrainOptions& config, const Scene& scene, WarmUpImage& p) {
  const size_t pixels = TILE * TILE;
  if (have_own_colors(config.loss.camera_color, scene)) {
    CameraColors colors(queue, 1, {});
    colors.show(queue, 0, pixels, p.images.rgb);
    colors.backward(queue, 0, pixels, p.images.rgb, p.v.v_rgb);
    colors.step(queue);
  }
  ImageLoss image(queue, config.loss.ssim);
  image.run(queue, TILE, TILE, p.images.rgb, zeros<cl_uchar>(queue, 3 * pixels), p.v.v_rgb);
  image.value(queue);
  if (config.loss.depth > 0) {
    DepthLoss depth(queue, DepthObjective::fit_of(config.scene.depth), config.loss.depth_knee, 1);
    const Buffer<float> file = zeros<float>(queue, pixels);
    Buffer<float> v_depth = zeros<float>(queue, pixels);
    depth.fit(queue, 0, pixels, p.images.alpha, p.images.alpha, file);
    depth.run(queue, 1, 0, pixels, p.images.alpha, p.images.alpha, file, v_depth, p.v.v_alpha);
    depth.value(queue);
  }
  if (!config.flow.enabled) return;
  FlowLoss flow(queue, config.flow.robust_px);
  flow.run(queue, 1, TILE, TILE, p.images.flow, p.images.alpha, zeros<float>(queue, 2 * pixels),
           zeros<cl_uchar>(queue, pixels), p.v.v_flow);
  queue.finish();
}

void learn(Queue& queue, const TrainOptions& config, Parameters& parameters) {
  Adam adam(queue, {config.adam.beta1, config.adam.beta2});
  for (Table* table : parameters.tables()) {
    adam.refuse(queue, table->groups[0], table->rows, table->count);
    adam.advance(queue, table->rows, table->count);
    adam.step(queue, table->groups[0], table->rows, table->count, {1, 1});
  }
  queue.finish();
}

void roll_back(Queue& queue, Model& model, WarmUpImage& p) {
  MotionOptions every_term;
  HexplaneOptions& rule = every_term.hexplane;
  rule.plane_tv = rule.time_smoothness = rule.l1_time = 1;
  Parameters& parameters = model.parameters;
  const Buffer<cl_uint>& seen = p.splats.tiles_touched;
  GaussianGradients& g = p.gradients;
  model.color.backward(queue, parameters, model.color.bands(0, true), p.view.camera, p.gaussians,
                       seen, g);
  model.motion->at(queue, parameters, 0, nullptr, p.gaussians);
  model.motion->backward(queue, parameters, 0, true, seen, g.v_means, g.v_factors, g.v_opacities);
  model.motion->regularize(queue, parameters, every_term);
  model.motion->set_rate_scales(queue, parameters, {1, 1, 1, 1});
  queue.finish();
}

void go_forth(Queue& queue, bool flow, Model& model, WarmUpImage& p) {
  const Buffer<cl_uint>& seen = p.splats.tiles_touched;
  Buffer<float> colors;
  if (flow) model.motion->at(queue, model.parameters, 0, &seen, p.gaussians);
  ViewRows rows(queue);
  if (model.motion->cull(queue, model.parameters, 0, p.view.camera, rows))
    rows.take_marked(queue, model.parameters);
  model.motion->at(queue, model.parameters, 0, nullptr, p.gaussians);
  model.color.forward(queue, model.parameters, model.color.bands(0, true), p.view.camera,
                      p.gaussians, seen, colors);
  queue.finish();
}

}  // namespace

void warm_up_kernels(Queue& queue, const TrainOptions& config) {
  const Scene scene = read_scene(config.scene.path, config.scene);
  const ModelShape shape = model_shape(scene, config);
  const EngineSettings settings = engine_settings(config);
  const bool flow = config.flow.enabled;
  WarmUpImage image(queue);
  // Permanent models have no static Gaussians and evaluate flow in all tiles, so with flow they
  // never render without it.
  const bool depth = config.loss.depth > 0;
  if (!flow || !is_permanent(shape.motion)) draw_and_return(queue, settings, {false, depth}, image);
  if (flow) draw_and_return(queue, settings, {true, depth}, image);
  Model model(queue, shape, 1);
  for (Table* table : model.parameters.tables())
    for (ParameterGroup& group : table->groups) group.values.fill(queue, 0.f);
  model.parameters.forget_seen(queue);
  roll_back(queue, model, image);
  learn(queue, config, model.parameters);
  compare(queue, config, scene, image);
  go_forth(queue, flow, model, image);
}

}  // namespace gflow
