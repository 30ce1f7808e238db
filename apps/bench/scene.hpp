// SPDX-License-Identifier: Apache-2.0
// What is drawn when the engine is measured: random Gaussians that move, or those of a file.
#pragma once
#include <memory>
#include <string>

#include "optim/engine/engine.hpp"
#include "optim/motion/models.hpp"

namespace gflow::bench {

struct BenchScene {
  std::string name;  // e.g. "512x512, 100000"
  View view;         // both cameras
  // Of a random scene: spacetime parameters, drawn at t1 and t2. Those of a file are at both times.
  std::unique_ptr<Motion> motion;
  std::unique_ptr<Parameters> parameters;
  float t1 = 0, t2 = 1;
  GaussiansAt at_t1, at_t2;
  Buffer<float> colors{"colors"};
  size_t count = 0;

  // Sets at_t1 and at_t2, of all, where there is a motion.
  void pose(Queue& queue) {
    if (!motion) return;
    const Buffer<cl_uint> all(queue, std::vector<cl_uint>(count, 1u), "all");
    motion->at(queue, *parameters, t1, nullptr, at_t1);
    motion->at(queue, *parameters, t2, &all, at_t2);
  }
};

// Normal random cotangents of an image, with a plane more for each channel.
ImageGradients random_gradients(Queue& queue, size_t pixels, Channels channels);

// Gaussians before a camera: projected means uniform in the picture, anisotropic, opacities
// sigmoid(N(-0.2, 1.5)), and so large that about 48 of them are blended in a pixel, whatever their
// number; they move by about a pixel and turn. With frames > 1 so many are there in each of them,
// for it alone; the one in the middle is drawn.
BenchScene random_scene(Queue& queue, int width, int height, size_t count, size_t frames = 1);

// Those of a file for `gflow splat` (optim/engine/splat_file.hpp). Error when it has no second time
// and flow is wanted.
BenchScene scene_of_file(Queue& queue, const std::string& path, bool flow);

}  // namespace gflow::bench
