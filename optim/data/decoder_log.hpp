// SPDX-License-Identifier: Apache-2.0
// What OpenCV and the FFmpeg in it say on stderr by themselves.
#pragma once

namespace gflow {

// From now on they say nothing: a file they cannot read is an Error in a sentence of ours. The
// variables OPENCV_LOG_LEVEL and OPENCV_FFMPEG_LOGLEVEL, where set, decide instead. To be called
// before the first video is opened, and before other threads run.
void silence_decoders();

}  // namespace gflow
