// SPDX-License-Identifier: Apache-2.0
#include "optim/data/decoder_log.hpp"

#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>

namespace gflow {

void silence_decoders() {
  // FFmpeg's AV_LOG_QUIET; OpenCV reads the variable when it opens its first video.
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  if (!std::getenv("OPENCV_LOG_LEVEL"))
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

}  // namespace gflow
