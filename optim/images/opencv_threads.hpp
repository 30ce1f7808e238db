// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <opencv2/core/utility.hpp>

namespace gflow {

// OpenCV keeps to the thread that calls it, from here on and in the whole program: gflow works on
// several pictures at a time instead. DIS shares a picture out among OpenCV's threads, and its
// result depends on how many there are. Call it before others use OpenCV.
inline void give_opencv_one_thread() {
  static const bool once = (cv::setNumThreads(1), true);
  (void)once;
}

}  // namespace gflow
