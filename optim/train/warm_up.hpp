// SPDX-License-Identifier: Apache-2.0
// Kernel warm-up: a minimal training step that makes the driver compile the kernels.
#pragma once
#include "optim/options/train_options.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow {

// Launches the kernels of a training step on one invisible Gaussian, except those of binning and
// density control, which compile quickly. Begins with the kernels that training uses last. Error if
// the scene cannot be read.
void warm_up_kernels(Queue& queue, const TrainOptions& config);

}  // namespace gflow
