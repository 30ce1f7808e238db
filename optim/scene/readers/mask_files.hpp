// SPDX-License-Identifier: Apache-2.0
// Masks in a folder beside the images, found by name.
#pragma once
#include <string>

#include "optim/scene/scene.hpp"

namespace gflow {

// The mask of image NAME.EXT, a path relative to the image folder, in masks/ or mask/: NAME.EXT,
// NAME.EXT.png, NAME.png, NAME_mask.png or mask_NAME.png, the first that exists; empty if there is
// none. `source` is the file that names the image.
std::string find_mask(const std::string& folder, const std::string& image,
                      const std::string& source);

// Adds a notice if masks/ or mask/ has images, but no frame of the scene has a mask; `why` is the
// reason.
void report_unused_masks(const std::string& folder, const std::string& why, Scene& scene);

}  // namespace gflow
