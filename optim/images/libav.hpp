// SPDX-License-Identifier: Apache-2.0
// FFmpeg's libraries for reading and writing video: ownership, errors, and messages by file.
#pragma once
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include <memory>
#include <mutex>
#include <string>

namespace gflow {

struct LibavDelete {
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
template <class T>
using LibavPointer = std::unique_ptr<T, LibavDelete>;

// The error that an allocation or a call returned, in FFmpeg's words.
std::string libav_error(int code);

// The errors that the decoders of one file log; the first is kept. Thread-safe.
class LibavMessages {
 public:
  void add(const char* text);
  // The first message since the last call, without line end; empty if there was none.
  std::string take();

 private:
  std::mutex mutex_;
  std::string first_;
};

// Call before any other function of FFmpeg. Silences it: what contexts log whose `opaque` is a
// LibavMessages goes there, all else is dropped. Limits single allocations to 768 MB, which hold a
// frame of 16000 x 16000: it allocates tables of the length that a header states before reading
// them.
void prepare_libav();

}  // namespace gflow
