// SPDX-License-Identifier: Apache-2.0
// A run on a video whose camera moves: its poses are found first, and the run trains on a scene of
// its own, RUN/scene.
#pragma once
#include <optional>

#include "optim/cameras/find_cameras.hpp"
#include "optim/options/train_options.hpp"
#include "optim/runs/run_folder.hpp"

namespace gflow {

// If the scene of the settings is a video, or numbered images, of a camera that moves, finds its
// poses (optim/cameras) and sets scene.path to RUN/scene, which it makes. One made before from the
// same frames is used again; if the run is resumed, one from the same video. Other scenes, and
// videos with scene.still or scene.cameras, are left alone. Error if the camera moves and its poses
// cannot be found.
// method: nullopt for tracks, if the camera moves; a method is also tried on images from which that
// cannot be told. Error if one is given for a scene that is left alone.
void find_cameras_of_video(TrainOptions& config, const RunFolder& run,
                           std::optional<CameraMethod> method, bool resumes, bool quiet);

}  // namespace gflow
