// SPDX-License-Identifier: Apache-2.0
// Scenes for measuring the engine: random moving Gaussians, or those of a file.
#pragma once
#include <memory>
#include <string>

#include "optim/engine/engine.hpp"
#include "optim/motion/models.hpp"

namespace gflow::bench {

struct BenchScene {
  std::string name;  // e.g. "512x512, 100000"
  View view;         // both cameras
  // For a random scene: spacetime parameters, drawn at t1 and t2. A file has Gaussians at both
  // times.
  std::unique_ptr<Motion> motion;
  std::unique_ptr<Parameters> parameters;
  float t1 = 0, t2 = 1;
  GaussiansAt at_t1, at_t2;
  Buffer<float> colors{"colors"};
  size_t count = 0;

  // Computes at_t1 and at_t2 for all rows if there is a motion model.
  void pose(Queue& queue) {
    if (!motion) return;
    const Buffer<cl_uint> all(queue, std::vector<cl_uint>(count, 1u), "all");
    motion->at(queue, *parameters, t1, nullptr, at_t1);
    motion->at(queue, *parameters, t2, &all, at_t2);
  }
};

// Normally distributed cotangents of an image, including those of the optional channels.
ImageGradients random_gradients(Queue& queue, size_t pixels, Channels channels);

// Gaussians in front of a camera: projected means uniform in the image, anisotropic, opacities
// sigmoid(N(-0.2, 1.5)), sized so that about 48 are blended per pixel whatever their number. They
// move by about a pixel and rotate. With frames > 1 each frame has `count` Gaussians of its own;
// the middle frame is drawn.
BenchScene random_scene(Queue& queue, int width, int height, size_t count, size_t frames = 1);

// The Gaussians of a file for `gflow splat` (optim/engine/splat_file.hpp). Error if flow is wanted
// and the file has no second time.
BenchScene scene_of_file(Queue& queue, const std::string& path, bool flow);

}  // namespace gflow::bench
