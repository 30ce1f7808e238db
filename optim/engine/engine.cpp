// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/engine.hpp"

#include <fmt/format.h>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// The kernels would read beyond buffers that are too small.
void require_gradients(const Images& images, Channels channels, const ImageGradients& v) {
  const size_t pixels = size_t(images.width) * size_t(images.height);
  const auto require = [&](const char* name, const Buffer<float>& gradient, size_t planes) {
    if (gradient.size() < planes * pixels)
      throw Error(
          fmt::format("gradients of an image: {} has {} values, but {} x {} x {} are needed", name,
                      gradient.size(), planes, images.height, images.width));
  };
  require("v_rgb", v.v_rgb, 3);
  require("v_alpha", v.v_alpha, 1);
  require("v_depth", v.v_depth, channels.depth ? 1 : 0);
  require("v_flow", v.v_flow, channels.flow ? 2 : 0);
}

}  // namespace

struct Engine::Steps {
  Steps(Queue& queue, const EngineSettings& settings, Channels channels)
      : project(queue, settings, channels), splatting(queue, settings, channels) {}
  Project project;
  Splatting splatting;
};

Engine::Engine(Queue& queue, const EngineSettings& settings)
    : settings_(settings), bin_(queue, settings) {}
Engine::~Engine() = default;

Engine::Steps& Engine::steps_for(Queue& queue, Channels channels) {
  auto& steps = steps_[int(channels.flow) + 2 * int(channels.depth)];
  if (!steps) steps = std::make_unique<Steps>(queue, settings_, channels);
  return *steps;
}

Splatting& Engine::without_flow(Queue& queue) {
  return steps_for(queue, {false, channels_.depth}).splatting;
}

bool Engine::shared() const {
  return channels_.flow && (view_.flow_tiles || movers() < splats_.count);
}

size_t Engine::movers() const {
  return settings_.skip.flow && settings_.top_k == 0 ? view_.moving : all_rows;
}

bool Engine::flow_in_parts(const ImageGradients& v) const {
  return channels_.flow && settings_.skip.flow && (shared() || v.flow_in_parts);
}

void Engine::project(Queue& queue, const View& view, Channels channels, const GaussiansAt& at_t1) {
  view_ = view;
  channels_ = channels;
  images_.width = view.camera.width;
  images_.height = view.camera.height;
  steps_for(queue, channels).project.forward(queue, view, at_t1, splats_);
  bin_.start(queue, splats_, tiles_);
}

void Engine::draw(Queue& queue, const std::array<float, 3>& background, const GaussiansAt& at_t1,
                  const GaussiansAt& at_t2, const Buffer<float>& colors) {
  Steps& steps = steps_for(queue, channels_);
  steps.project.complete(queue, view_, at_t1, at_t2, colors, splats_);
  bin_.build(queue, images_.width, images_.height, splats_, tiles_);
  with_flow_ = nullptr;
  if (!shared()) return steps.splatting.forward(queue, background, splats_, tiles_, images_);
  with_flow_ = &steps.splatting.tiles_with_flow(queue, view_.flow_tiles, movers(), tiles_);
  steps.splatting.forward(queue, background, splats_, tiles_, images_, with_flow_);
  without_flow(queue).forward(queue, background, splats_, tiles_, images_, with_flow_);
}

void Engine::backward(Queue& queue, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                      const ImageGradients& v, GaussianGradients& gradients) {
  require_gradients(images_, channels_, v);
  Steps& steps = steps_for(queue, channels_);
  const bool parts = flow_in_parts(v);
  steps.splatting.backward(queue, splats_, tiles_, images_, v, partials_, parts);
  if (parts) without_flow(queue).backward(queue, splats_, tiles_, images_, v, partials_, parts);
  steps.splatting.gather(queue, splats_, tiles_, partials_, moments_);
  steps.project.backward(queue, view_, at_t1, at_t2, splats_, moments_, gradients);
}

}  // namespace gflow
