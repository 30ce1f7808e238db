// SPDX-License-Identifier: Apache-2.0
// Training as one call, for programs; without run folder or terminal. Warnings go to the observer,
// without one to stderr.
#pragma once
#include "optim/train/train_loop.hpp"

namespace gflow {

struct TrainResult {
  HostModel model;
  int steps = 0;      // steps made; fewer than options.train.iterations if the observer stopped it
  StepReport report;  // report of the last step
  std::vector<Camera> cameras;  // of the scene, as they were corrected (cameras.refine)
};

// Trains on a scene from read_scene(), or one in memory (complete_scene()). options.scene.path is
// not used. Computed optical flow is kept in a temporary folder. The same inputs give bitwise equal
// results. Error if scene, options or device do not allow training; exceptions of the observer pass
// through.
TrainResult train(Queue& queue, Scene scene, const TrainOptions& options,
                  const TrainExtensions& extensions = {});

}  // namespace gflow
