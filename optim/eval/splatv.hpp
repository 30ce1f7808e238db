// SPDX-License-Identifier: Apache-2.0
// .splatv files: moving splats for web viewers (antimatter15/splaTV, gsplat.js).
#pragma once
#include "optim/model/model.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// The paths, turns and lives of a spacetime or native4d model are the format's own: exact up to its
// half floats. Colour is that of degree 0, the same from all sides. The viewer starts at the first
// camera; at least one is needed. Error for other motion models.
void write_splatv(const std::string& path, const HostModel& model,
                  const std::vector<Camera>& cameras);

}  // namespace gflow
