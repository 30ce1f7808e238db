// SPDX-License-Identifier: Apache-2.0
// Exact conversion of native4d models to spacetime models.
#pragma once
#include "optim/model/model.hpp"

namespace gflow {

// Returns a spacetime model unchanged. In a native4d model each Gaussian becomes one through the
// same mean with the velocity and shape of its slice and the same lifetime
// (kernels/shared/motion/native4d.h). Error, which begins with `what`, for other motion models:
// their paths cannot be expressed.
HostModel as_spacetime(HostModel model, const std::string& what);

}  // namespace gflow
