// SPDX-License-Identifier: Apache-2.0
// The camera of a plain video or folder of pictures: given in a file, or one that stands still and
// looks at the origin.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Cameras of a view of `pictures` pictures of that size, of which `source` is one. Without
// options.cameras one static_camera at azimuth 0, called input. Else those of that file, a
// cameras.json or a transforms file (optim/scene/readers/transforms_file.hpp): the one called
// options.camera (folder and extension may be left out), the only one there is, or one a picture,
// in natural order of their names. Scaled to the size. Error when there are neither one nor as many
// as pictures.
std::vector<Camera> cameras_of_view(const SceneOptions& options, size_t pictures, int width,
                                    int height, const std::string& source);

}  // namespace gflow
