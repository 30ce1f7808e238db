// SPDX-License-Identifier: Apache-2.0
// Corrects the cameras of a scene that one moving camera films, before training: a training starts
// from what is at rest, which poses that are off by a degree hide.
#pragma once
#include "optim/scene/frame_store.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

// Adjusts the poses of the training frames and their focal length to feature tracks, in `frames`;
// world and scale stay the same on average, and other cameras follow. Returns the root mean square
// of the corrections [degrees]; nullopt, with a warning, if the frames have no common lens or too
// few tracks. progress: in images.
std::optional<double> correct_cameras(const Scene& scene, FrameStore& frames,
                                      const ProgressCallback& progress);

}  // namespace gflow
