// SPDX-License-Identifier: Apache-2.0
// A training step with next to nothing in it, for what it makes the driver do: compile the kernels.
#pragma once
#include "optim/options/train_options.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow {

// Launches the kernels of a training step, but for those of binning and density control, which are
// soon compiled, on one Gaussian that nobody sees. Those come first that a training comes to last.
// Error where the scene cannot be read.
void warm_up_kernels(Queue& queue, const TrainOptions& config);

}  // namespace gflow
