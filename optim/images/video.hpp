// SPDX-License-Identifier: Apache-2.0
// Video files, decoded by OpenCV. Seeking by number is not trusted: containers state wrong key
// frames, so frames are counted from the start or from where the last call stopped.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "optim/images/image.hpp"

namespace gflow {

// What a video says about itself. `frames` is the container's number; only where it states none
// the frames are counted.
struct VideoInfo {
  int width = 0, height = 0, frames = 0;
  double fps = 0;
};

// Error when the file is missing, is no video OpenCV can open, or has no frames.
VideoInfo video_info(const std::string& path);

// When each frame is shown, in seconds from the first, strictly rising: the container's time
// stamps, or k / fps where it has none that rise. Every frame is decoded, so there are as many as
// frame() gives, whatever the header says; at most `limit` when > 0. Error as video_info.
std::vector<double> frame_times(const std::string& path, int limit = 0);

// An open video. Reading frames in rising order is fast; going back starts again.
class Video {
 public:
  explicit Video(const std::string& path);
  ~Video();
  Video(Video&&) noexcept;
  Video& operator=(Video&&) noexcept;

  // Frame k as RGB. Error when the video has no such frame.
  Image frame(int k);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
