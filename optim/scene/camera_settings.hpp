// SPDX-License-Identifier: Apache-2.0
// The settings scene.skip_cameras and scene.time_offsets, which name cameras of a scene: by
// Camera::name, of which the extension of an image may be omitted.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/scene.hpp"

namespace gflow {

// The entries of a list separated by commas, without blanks around them.
std::vector<std::string> entries_of(const std::string& list);

// Whether each camera is in a list of names separated by commas. Error if there is no camera of a
// name, or if none is left.
std::vector<bool> skipped_cameras(const std::vector<Camera>& cameras, const std::string& list);

// Leaves out these cameras and their frames. The steps are those that training frames still have.
// Adds a notice if no test views are left. Error if no training frames are left.
void skip_cameras(Scene& scene, const std::string& list);

// Shifts the times of cameras by a list such as "cam03=0.5, cam07=-1", in frames: mean intervals of
// the training times. Frames that leave the video are dropped with a notice; the others belong to
// the nearest step. Error if the list cannot be read or there is no camera of a name.
void shift_times(Scene& scene, const std::string& list);

}  // namespace gflow
