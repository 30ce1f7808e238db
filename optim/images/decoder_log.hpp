// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace gflow {

// Silences OpenCV's log on stderr: what it cannot do raises an Error of gflow. The environment
// variable OPENCV_LOG_LEVEL takes precedence. Call before other threads start.
void silence_opencv();

}  // namespace gflow
