// SPDX-License-Identifier: Apache-2.0
#include "optim/images/decoder_log.hpp"

#include <dlfcn.h>

#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>

namespace gflow {
namespace {

std::mutex complaint_mutex;
std::string complaint;  // guarded by complaint_mutex

// FFmpeg's av_log callback. Decoder threads call it concurrently.
void keep_errors(void*, int level, const char* format, va_list arguments) {
  constexpr int error = 16;  // AV_LOG_ERROR; lower levels are more severe
  if (level > error) return;
  char said[256];
  std::vsnprintf(said, sizeof said, format, arguments);
  const std::lock_guard<std::mutex> lock(complaint_mutex);
  if (complaint.empty()) complaint = said;
}

}  // namespace

void capture_decoder_errors() {
  // FFmpeg is not linked directly, only through OpenCV if that was built with it. If
  // OPENCV_FFMPEG_LOGLEVEL is set, OpenCV installs a callback of its own.
  using Callback = void (*)(void*, int, const char*, va_list);
  void* const set_callback = dlsym(RTLD_DEFAULT, "av_log_set_callback");
  if (set_callback && !std::getenv("OPENCV_FFMPEG_LOGLEVEL"))
    reinterpret_cast<void (*)(Callback)>(set_callback)(keep_errors);
  if (!std::getenv("OPENCV_LOG_LEVEL"))
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

std::string take_decoder_error() {
  const std::lock_guard<std::mutex> lock(complaint_mutex);
  std::string taken;
  taken.swap(complaint);
  while (!taken.empty() && taken.back() == '\n') taken.pop_back();
  return taken;
}

}  // namespace gflow
