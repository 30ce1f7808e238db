// SPDX-License-Identifier: Apache-2.0
// 4D Gaussians in the coordinates of the spacetime model: exactly the same thing to look at.
#pragma once
#include "optim/model/model.hpp"

namespace gflow {

// A spacetime model as it is; each Gaussian of a native4d model as one that goes through its mean
// with the velocity and the shape of its cut and lives as long (kernels/shared/native4d.h). Error,
// which begins with `what`, for other motion models: they bend.
HostModel as_spacetime(HostModel model, const std::string& what);

}  // namespace gflow
