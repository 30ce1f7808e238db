// SPDX-License-Identifier: Apache-2.0
// Long videos, a frame at a time: no more than one picture is in memory.
#pragma once
#include <functional>
#include <string>

#include "optim/data/image.hpp"

namespace gflow {

// `count` RGB pictures of one size as an MP4, frame(0), frame(1), ...; encoders, padding and errors
// as write_mp4. The file appears complete or not at all.
void write_movie(const std::string& path, size_t count, const std::function<Image(size_t)>& frame,
                 double fps);

}  // namespace gflow
