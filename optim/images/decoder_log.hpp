// SPDX-License-Identifier: Apache-2.0
// What OpenCV and the FFmpeg in it say of what they read.
#pragma once
#include <string>

namespace gflow {

// From now on they write nothing on stderr: a file they cannot read is an Error in a sentence of
// ours, and what FFmpeg calls an error is kept for take_decoder_complaint(). The variables
// OPENCV_LOG_LEVEL and OPENCV_FFMPEG_LOGLEVEL, where set, decide instead. To be called before the
// first video is opened, and before other threads run.
void listen_to_decoders();

// The first error that any decoder of this process has spoken of since the last call, as it said
// it; empty: none, or nobody listens.
std::string take_decoder_complaint();

}  // namespace gflow
