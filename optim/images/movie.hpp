// SPDX-License-Identifier: Apache-2.0
// Writes videos frame by frame; only one frame is in memory.
#pragma once
#include <functional>
#include <string>

#include "optim/images/image.hpp"

namespace gflow {

// Range of an MP4's frame rate [frames/s].
inline constexpr double slowest_fps = 0.01, fastest_fps = 1000;

// Writes `count` RGB frames of one size, frame(0), frame(1), ..., as an MP4 (H.264, else MPEG-4).
// Odd sizes are padded by repeating the last row or column. Replaces the file atomically. Error if
// FFmpeg has no encoder, or fps is outside of slowest_fps to fastest_fps.
void write_movie(const std::string& path, size_t count, const std::function<Image(size_t)>& frame,
                 double fps);

}  // namespace gflow
