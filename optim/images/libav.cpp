// SPDX-License-Identifier: Apache-2.0
#include "optim/images/libav.hpp"

extern "C" {
#include <libavutil/mem.h>
}

#include <cstdarg>
#include <cstdio>
#include <cstring>

namespace gflow {
namespace {

// FFmpeg's log callback; its decoding threads call it, too.
void keep_errors(void* context, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_ERROR || !context) return;
  const AVClass* kind = *static_cast<AVClass**>(context);
  void* owner = nullptr;
  if (kind == avcodec_get_class()) owner = static_cast<AVCodecContext*>(context)->opaque;
  if (kind == avformat_get_class()) owner = static_cast<AVFormatContext*>(context)->opaque;
  if (!owner) return;
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  static_cast<LibavMessages*>(owner)->add(text);
}

}  // namespace

std::string libav_error(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

void LibavMessages::add(const char* text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (first_.empty()) first_ = text;
}

std::string LibavMessages::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::string taken;
  taken.swap(first_);
  while (!taken.empty() && taken.back() == '\n') taken.pop_back();
  return taken;
}

void prepare_libav() {
  static const bool done = [] {
    av_log_set_callback(keep_errors);
    av_max_alloc(size_t{768} << 20);
    return true;
  }();
  (void)done;
}

}  // namespace gflow
