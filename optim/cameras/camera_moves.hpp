// SPDX-License-Identifier: Apache-2.0
// A quick look at a video: does its camera stand still?
#pragma once
#include <vector>

#include "optim/scene/frame_store.hpp"

namespace gflow {

// Whether most points near the border of the image move by more than a pixel within some frames, at
// one of three places of the video. frames: of one camera, in order. False where there are too few
// points near the border to tell.
bool camera_moves(const std::vector<Frame>& frames, FrameStore& store);

}  // namespace gflow
