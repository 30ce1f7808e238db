// SPDX-License-Identifier: Apache-2.0
// Videos written a frame at a time: no more than one picture is in memory.
#pragma once
#include <functional>
#include <string>

#include "optim/images/image.hpp"

namespace gflow {

// Frames a second that an MP4 can have.
inline constexpr double slowest_fps = 0.01, fastest_fps = 1000;

// `count` RGB pictures of one size, frame(0), frame(1), ..., as an MP4 (avc1 or mp4v, whichever
// this OpenCV can write). Sizes are padded to even numbers by repeating the last row or column.
// Error when OpenCV has no encoder, or fps is not from slowest_fps to fastest_fps. The file appears
// complete or not at all.
void write_movie(const std::string& path, size_t count, const std::function<Image(size_t)>& frame,
                 double fps);

}  // namespace gflow
