// SPDX-License-Identifier: Apache-2.0
// The video stream of a file: demuxing and decoding, one frame after the other.
#pragma once
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "optim/images/libav.hpp"
#include "optim/images/video_frame.hpp"

namespace gflow {

class VideoStream {
 public:
  // Opens the file and its best video stream. Error if it is missing, empty, unreadable, not a
  // video, or a playlist, which could name any other file.
  explicit VideoStream(const std::string& path);
  ~VideoStream();
  VideoStream(const VideoStream&) = delete;
  VideoStream& operator=(const VideoStream&) = delete;

  // Decodes the next frame that is shown; false at the end, or where the file is cut off.
  bool next();
  // The frame of the last next().
  const AVFrame& frame() const { return *frame_; }
  // Its time stamp [s]; NaN if it has none.
  double time() const;
  Image image();

  const AVStream& stream() const { return *stream_; }
  const AVCodecContext& decoder() const { return *decoder_; }
  Orientation orientation() const;
  AVRational pixel_aspect() const;
  bool has_alpha() const;
  // Number of frames that are shown, as the container states; 0: it does not.
  int stated_frames() const;
  // Duration of the stream, as the container states [s]; 0: it does not.
  double stated_seconds() const;
  // Time stamps of the packets from here to the end of the file whose frames are shown, ascending
  // [s]; NaN for packets without one, last. Decodes nothing.
  std::vector<double> packet_times();

 private:
  static int overdue(void* stream);
  void open(const std::string& path);
  bool feed();
  // stamp: of the packet or frame, in units of the stream, or AV_NOPTS_VALUE.
  void note_damage(int64_t stamp, int code);
  [[noreturn]] void fail(const std::string& why) const;

  std::string path_;
  LibavMessages messages_;
  std::chrono::steady_clock::time_point deadline_;
  AVFormatContext* file_ = nullptr;
  AVStream* stream_ = nullptr;
  LibavPointer<AVCodecContext> decoder_;
  LibavPointer<AVPacket> packet_;
  LibavPointer<AVFrame> frame_;
  FrameConverter converter_;
  int64_t sent_ = AV_NOPTS_VALUE;  // time stamp of the last packet that had one
  bool ended_ = false;
};

}  // namespace gflow
