// SPDX-License-Identifier: Apache-2.0
// Cameras of a plain video or a folder of images: given in a file, or one static camera that looks
// at the origin.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Cameras of a view with `count` images of this size; `source` is one of them, for errors.
// Without options.cameras: static_camera "input" at azimuth 0. Otherwise from that file, a
// cameras.json or a transforms file (optim/scene/readers/transforms_file.hpp): the camera named
// options.camera (folder and extension may be omitted), the only camera, or one per image in
// natural order of names. Scaled to the image size. Error if the number of cameras is neither 1 nor
// that of the images.
std::vector<Camera> cameras_of_view(const SceneOptions& options, size_t count, int width,
                                    int height, const std::string& source);

}  // namespace gflow
