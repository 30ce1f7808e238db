// SPDX-License-Identifier: Apache-2.0
// A model of COLMAP in the form of gflow's own reconstructions.
#pragma once
#include <string>

#include "optim/cameras/bundle.hpp"

namespace gflow {

// A camera path and the tracks of its points.
struct TrackedPath {
  std::vector<FeatureTrack> tracks;
  CameraPath path;
};

// Reads the text files of a model in a folder: one SIMPLE_PINHOLE or SIMPLE_RADIAL camera, images
// with the names that image_name() (camera_scene.hpp) gives to `frames` frames, and points. A track
// goes from the first frame that shows its point to the last; frames between that do not show it
// are not `used`. Error if a file is missing or has other contents.
TrackedPath read_colmap_tracks(const std::string& folder, size_t frames);

}  // namespace gflow
