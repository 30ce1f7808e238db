// SPDX-License-Identifier: Apache-2.0
// Video files, decoded by OpenCV. Frames are counted from the start, or from the last frame read.
// Seeking by number is unreliable, because containers state wrong key frames.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "optim/images/image.hpp"

namespace gflow {

// Properties of a video. `frames` is the container's number; frames are counted only if it states
// none.
struct VideoInfo {
  int width = 0, height = 0, frames = 0;
  double fps = 0;
};

// Error if the file is missing, OpenCV cannot open it, or it has no frames.
VideoInfo video_info(const std::string& path);

// Display time of each frame [s], relative to the first, strictly increasing: the container's time
// stamps, or k / fps if those do not increase. Decodes every frame, so the count matches frame()
// whatever the header says; at most `limit` frames if > 0. Errors as video_info.
std::vector<double> frame_times(const std::string& path, int limit = 0);

// An open video. Reading frames in increasing order is fast; going back restarts from the
// beginning.
class Video {
 public:
  explicit Video(const std::string& path);
  ~Video();
  Video(Video&&) noexcept;
  Video& operator=(Video&&) noexcept;

  // Frame k as RGB. Error if the video has no such frame.
  Image frame(int k);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
