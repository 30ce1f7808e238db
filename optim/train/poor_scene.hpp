// SPDX-License-Identifier: Apache-2.0
// Warnings of scenes whose metrics are excellent although nothing can be learned from them.
#pragma once
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Warns if all training images are of one colour, as those of a black video, or if images of one
// camera at a time show fewer than four distinct times. Photographs of a static scene, and objects
// cut out by alpha, are fine.
void warn_of_poor_scene(const Scene& scene, FrameStore& store);

}  // namespace gflow
