// SPDX-License-Identifier: Apache-2.0
// The engine: one differentiable function from Gaussians at two times to images, in four steps
// (project, bin, splat; and backward). It knows nothing of parameters, losses or training.
#pragma once
#include <map>
#include <memory>

#include "optim/engine/splat.hpp"

namespace gflow {

class Engine {
 public:
  explicit Engine(Queue& queue, const EngineSettings& settings = {});
  ~Engine();

  // Decides what `view` sees of the Gaussians at t1: splats().tiles_touched.
  void project(Queue& queue, const View& view, Channels channels, const GaussiansAt& at_t1);
  // Draws it. Of colors and, with channels.flow, at_t2 only the rows that are seen are read;
  // without flow at_t1 may be passed again. The result stays in images() until the next draw().
  void draw(Queue& queue, const std::array<float, 3>& background, const GaussiansAt& at_t1,
            const GaussiansAt& at_t2, const Buffer<float>& colors);
  // Both, when everything is known beforehand.
  void forward(Queue& queue, const View& view, Channels channels,
               const std::array<float, 3>& background, const GaussiansAt& at_t1,
               const GaussiansAt& at_t2, const Buffer<float>& colors) {
    project(queue, view, channels, at_t1);
    draw(queue, background, at_t1, at_t2, colors);
  }

  // Gradients of sum(images . v) for the last draw(), of which the inputs are given again.
  void backward(Queue& queue, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const ImageGradients& v, GaussianGradients& gradients);

  const Images& images() const { return images_; }
  const Splats& splats() const { return splats_; }
  const Tiles& tiles() const { return tiles_; }
  // Of the last draw() with flow, 1 for each tile that has some; nullptr: all have.
  const Buffer<cl_uchar>* tiles_with_flow() const { return with_flow_; }
  // Whether the way back from the last draw() leaves flow out in tiles whose v_flow is 0
  // throughout.
  bool flow_in_parts(const ImageGradients& v) const;

 private:
  struct Steps;  // the kernels of one choice of channels, compiled when first used
  Steps& steps_for(Queue& queue, Channels channels);
  // Draws the tiles without flow of pictures with flow,
  Splatting& without_flow(Queue& queue);
  // which there are when something stands still in the view, or tiles were chosen.
  bool shared() const;
  // The rows below this decide which tiles have flow. With top_k all: the weights that flow is
  // divided by are the flow kernel's, and what rests is told by them, too, where it should be.
  size_t movers() const;

  EngineSettings settings_;
  Bin bin_;
  std::map<int, std::unique_ptr<Steps>> steps_;
  View view_{};
  Channels channels_;
  Splats splats_;
  Tiles tiles_;
  Images images_;
  const Buffer<cl_uchar>* with_flow_ = nullptr;  // of a Splatting
  Buffer<float> partials_{"partials"};           // [M, 16]
  Buffer<float> moments_{"moments"};             // [N, 16]
};

}  // namespace gflow
