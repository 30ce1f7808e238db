// SPDX-License-Identifier: Apache-2.0
#include "optim/images/decoder_log.hpp"

#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>

namespace gflow {

void silence_opencv() {
  if (!std::getenv("OPENCV_LOG_LEVEL"))
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

}  // namespace gflow
