// SPDX-License-Identifier: Apache-2.0
// Corrected poses of training cameras, which other cameras follow.
#pragma once
#include <map>

#include "optim/scene/frame_store.hpp"

namespace gflow {

// Gives cameras of the scene, by index, other poses (world to camera), and the focal lengths of all
// this multiple of those of the scene. The other cameras move by the similarity that maps the
// scene's poses of these cameras to the new ones.
void move_cameras(const Scene& scene, const std::map<size_t, Eigen::Matrix4d>& poses, double focal,
                  FrameStore& frames);

// Moves the cameras without training frames as move_cameras() does for the training cameras as they
// are: an earlier evaluation has fitted the others to their images.
void undo_fits(const Scene& scene, FrameStore& frames);

}  // namespace gflow
