// SPDX-License-Identifier: Apache-2.0
// Finds the frames of one moving camera, for layouts that only store a pose per image.
#pragma once
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Whether optical flow can be estimated between two views: images have equal size, and points at
// half, once and twice `depth` in front of `from` (centre, corners and edge midpoints of its image)
// move by less than a fifth of the width. Depths other than `depth` matter because a camera that
// orbits an object displaces the object's centre least.
bool are_near(const Camera& from, const Camera& to, double depth);

// Sets Frame::track of a split. Frames with one camera index, that is one pose, are one track,
// unless the split is a video of a moving camera: one image per time, and more than half of the
// steps lead to a near view (are_near). Then the track continues from image to image, and a new one
// begins where two views are not near, as at a cut. A camera that jumps at each step, as in D-NeRF,
// is not a video, even if two of its views happen to be near.
void find_tracks(const Scene& scene, std::vector<Frame>& frames);

}  // namespace gflow
