// SPDX-License-Identifier: Apache-2.0
// Log output of OpenCV and of the FFmpeg inside it.
#pragma once
#include <string>

namespace gflow {

// Silences both on stderr. A file they cannot read raises an Error of gflow, and FFmpeg's own
// errors are kept for take_decoder_error(). The environment variables OPENCV_LOG_LEVEL and
// OPENCV_FFMPEG_LOGLEVEL take precedence. Call before the first video is opened and before other
// threads start.
void capture_decoder_errors();

// The first FFmpeg error in this process since the last call, verbatim; empty if there was none or
// capture_decoder_errors was not called.
std::string take_decoder_error();

}  // namespace gflow
