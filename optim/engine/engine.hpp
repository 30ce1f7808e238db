// SPDX-License-Identifier: Apache-2.0
// The engine: a differentiable function from Gaussians at two times to images, in the steps
// project, bin and splat, and backward. It knows nothing about parameters, losses or training.
#pragma once
#include <map>
#include <memory>

#include "optim/engine/splat.hpp"

namespace gflow {

class Engine {
 public:
  explicit Engine(Queue& queue, const EngineSettings& settings = {});
  ~Engine();

  // Projects the Gaussians at t1 and decides which are visible in `view`: splats().tiles_touched.
  void project(Queue& queue, const View& view, Channels channels, const GaussiansAt& at_t1);
  // Renders the images. Only visible rows of colors and, with channels.flow, of at_t2 are read;
  // without flow at_t1 may be passed for at_t2. The result stays in images() until the next draw().
  void draw(Queue& queue, const std::array<float, 3>& background, const GaussiansAt& at_t1,
            const GaussiansAt& at_t2, const Buffer<float>& colors);
  // project() and draw(), if all inputs are known beforehand.
  void forward(Queue& queue, const View& view, Channels channels,
               const std::array<float, 3>& background, const GaussiansAt& at_t1,
               const GaussiansAt& at_t2, const Buffer<float>& colors) {
    project(queue, view, channels, at_t1);
    draw(queue, background, at_t1, at_t2, colors);
  }

  // Gradients of sum(images . v) for the last draw(), whose inputs are passed again.
  void backward(Queue& queue, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const ImageGradients& v, GaussianGradients& gradients);

  const Images& images() const { return images_; }
  const Splats& splats() const { return splats_; }
  const Tiles& tiles() const { return tiles_; }
  // 1 for each tile with flow in the last draw() with flow; nullptr: all tiles have flow.
  const Buffer<cl_uchar>* tiles_with_flow() const { return with_flow_; }
  // Whether backward() skips flow in tiles whose v_flow is 0 everywhere.
  bool flow_in_parts(const ImageGradients& v) const;

 private:
  struct Steps;  // kernels for one choice of channels, compiled on first use
  Steps& steps_for(Queue& queue, Channels channels);
  // Renders the tiles without flow of images with flow.
  Splatting& without_flow(Queue& queue);
  // Whether there are such tiles: some Gaussians are static in the view, or flow tiles were chosen.
  bool shared() const;
  // Rows below this determine which tiles have flow. All rows with top_k: only the flow kernel
  // writes flow_weight, which the flow gradients of static Gaussians need.
  size_t movers() const;

  EngineSettings settings_;
  Bin bin_;
  std::map<int, std::unique_ptr<Steps>> steps_;
  View view_{};
  Channels channels_;
  Splats splats_;
  Tiles tiles_;
  Images images_;
  const Buffer<cl_uchar>* with_flow_ = nullptr;  // owned by a Splatting
  Buffer<float> partials_{"partials"};           // [M, 16]
  Buffer<float> moments_{"moments"};             // [N, 16]
};

}  // namespace gflow
