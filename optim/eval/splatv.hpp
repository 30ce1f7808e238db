// SPDX-License-Identifier: Apache-2.0
// .splatv files: moving splats for web viewers (antimatter15/splaTV, gsplat.js).
#pragma once
#include "optim/model/model.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// Paths, rotations and lifetimes of spacetime and native4d models are exact up to half precision.
// Colour is that of degree 0. The viewer starts at the first camera; at least one is needed. Error
// for other motion models.
void write_splatv(const std::string& path, const HostModel& model,
                  const std::vector<Camera>& cameras);

}  // namespace gflow
