// SPDX-License-Identifier: Apache-2.0
// The part of the device self-check that needs a motion model: compares a backward kernel with the
// same formulas in double on the host.
#pragma once
#include "optim/engine/self_check.hpp"

namespace gflow {

// Relative L2 error of spacetime_bwd, the backward pass of the default model, over 64 random
// Gaussians; bound 1e-4 (device check T35). The host runs kernels/shared/motion/spacetime.h in
// double.
SelfCheckRow gradient_check(Queue& queue);

// The rows of self_check() and the row above: what a device must pass before it is used.
SelfCheck full_self_check(Queue& queue);

}  // namespace gflow
