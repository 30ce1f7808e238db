// SPDX-License-Identifier: Apache-2.0
// Training as one call, for programs: no run folder, no terminal.
#pragma once
#include "optim/train/train_loop.hpp"

namespace gflow {

struct TrainResult {
  HostModel model;
  int steps = 0;      // made; fewer than options.train.iterations where the observer stopped it
  StepReport report;  // of the last step
};

// Trains on a scene: read_scene()'s, or one in memory (complete_scene()). options.scene.path is not
// used. Optical flow that must be computed is kept in a temporary folder. The same inputs give the
// same bits. Error when scene, options or device do not allow a training; what the observer throws
// passes through.
TrainResult train(Queue& queue, Scene scene, const TrainOptions& options,
                  const TrainExtensions& extensions = {});

}  // namespace gflow
