// SPDX-License-Identifier: Apache-2.0
// Feature tracks on disk while the cameras of a video are being found: a search that was stopped
// continues from them.
#pragma once
#include <optional>
#include <string>

#include "optim/cameras/feature_tracks.hpp"

namespace gflow {

// Name of the file, in the folder of the scene until the scene is complete.
inline constexpr const char* kTrackFile = "tracks.npz";

// stamp: everything that the tracks depend on.
void write_tracks(const std::string& path, const std::string& stamp, const TrackingState& state);

// nullopt if the file is missing, damaged or has another stamp.
std::optional<TrackingState> read_tracks(const std::string& path, const std::string& stamp);

}  // namespace gflow
