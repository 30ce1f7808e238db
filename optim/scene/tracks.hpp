// SPDX-License-Identifier: Apache-2.0
// Which frames one moving camera filmed, for layouts that only tell each picture's pose.
#pragma once
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Whether optical flow can be estimated between two views: pictures of one size, and whatever lies
// half, once or twice `depth` ahead of `from` (centre, corners and edges of its picture) is
// displaced by less than a fifth of the width. The two other depths are there because a camera that
// goes around an object, to see another side of it, displaces least what lies at its centre.
bool are_near(const Camera& from, const Camera& to, double depth);

// Sets Frame::track of a split. Frames of one camera index, that is of one pose, are one track,
// unless the split is a video of a moving camera: one picture at a time, and more than half of the
// steps in time lead to a near view. Then the track goes on from picture to picture, and another
// begins where two views are not near, as at a cut. A camera that teleports at each step, as in
// D-NeRF, is no video, even if chance brings two of its views together.
void find_tracks(const Scene& scene, std::vector<Frame>& frames);

}  // namespace gflow
