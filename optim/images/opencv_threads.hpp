// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <opencv2/core/utility.hpp>

namespace gflow {

// Limits OpenCV to the calling thread, for the whole program: gflow processes several images in
// parallel instead. The result of DIS would also depend on OpenCV's number of threads. Call before
// any other use of OpenCV.
inline void limit_opencv_to_one_thread() {
  static const bool once = (cv::setNumThreads(1), true);
  (void)once;
}

}  // namespace gflow
