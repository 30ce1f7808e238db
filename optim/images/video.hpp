// SPDX-License-Identifier: Apache-2.0
// Video files, decoded by FFmpeg's libraries. Frames are those shown, in the order of their times:
// what an edit list cuts away is not there.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "optim/images/image.hpp"

namespace gflow {

// Properties of a video. Sizes are those shown: upright, with square pixels.
struct VideoInfo {
  int width = 0, height = 0;
  // As the container states, but at most as many as there are packets: files may be cut off, and
  // AVI counts frames that were dropped.
  int frames = 0;
  // Times of the packets [s], ascending from 0; empty if some have none. Nothing is decoded for
  // them.
  std::vector<double> times;
  double fps = 0;                           // average; 24 if it is unknown
  bool variable = false;                    // the intervals between frames differ
  double seconds = 0;                       // as the container states; 0 if it does not
  bool alpha = false;                       // the first frame is transparent somewhere
  std::string codec;                        // "h264"
  int stored_width = 0, stored_height = 0;  // in the file
  double pixel_aspect = 1;                  // width / height of a stored pixel
  int rotation = 0;                         // clockwise, to upright [degrees]
  bool mirrored = false;
  bool interlaced = false;  // frames are two half images of different times, line by line
  int bits = 8;             // per channel
  std::string colors;       // "BT.709, limited range"
};

// Error if the file is missing, not a video that FFmpeg can read, or has no frames.
VideoInfo video_info(const std::string& path);

// Display time of each frame [s], relative to the first, strictly increasing: the container's time
// stamps, or k / fps if those do not increase. Decodes every frame, so the count matches frame()
// whatever the header says; at most `limit` frames if > 0. Errors as video_info.
std::vector<double> frame_times(const std::string& path, int limit = 0);

// An open video. Reading frames in increasing order is fast; going back restarts from the
// beginning. Decoders go on after damage with wrong frames; a warning names the first damaged place
// of each file once.
class Video {
 public:
  explicit Video(const std::string& path);
  ~Video();
  Video(Video&&) noexcept;
  Video& operator=(Video&&) noexcept;

  // Frame k as RGB, or RGBA if the video has alpha. Error if it has no such frame.
  Image frame(int k);

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
