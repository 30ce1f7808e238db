// SPDX-License-Identifier: Apache-2.0
// The part of a device's self-check that needs the splat maths: one derivative kernel against the
// same text in double on the host. Under 0.1 s once compiled.
#pragma once
#include "runtime/primitives/self_check.hpp"

namespace gflow {

// Relative L2 error of spacetime_bwd, the default model's, over 64 random Gaussians, bound 1e-4
// (T35); the host runs kernels/shared/spacetime.h in double.
SelfCheckRow gradient_check(Queue& queue);

// runtime's self_check and the row above: what a device must pass before it is used.
SelfCheck full_self_check(Queue& queue);

}  // namespace gflow
