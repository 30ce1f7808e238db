// SPDX-License-Identifier: Apache-2.0
#include "optim/images/movie.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// Opens the first encoder that works: avc1 (H.264) plays everywhere, mp4v is always built in.
cv::VideoWriter open_writer(const std::string& temporary, const std::string& path, double fps,
                            cv::Size size) {
  cv::VideoWriter writer;
  for (const char* code : {"avc1", "mp4v"}) {
    const int fourcc = cv::VideoWriter::fourcc(code[0], code[1], code[2], code[3]);
    try {
      if (writer.open(temporary, cv::CAP_FFMPEG, fourcc, fps, size)) return writer;
    } catch (const cv::Exception&) {
      // Treated as an encoder that is not available.
    }
  }
  require_room(temporary, path);
  throw Error(
      fmt::format("cannot write video {}: this OpenCV has no MP4 encoder (needs FFmpeg)", path));
}

// The frame as the encoder needs it: BGR with even sides.
cv::Mat encodable(const Image& frame, cv::Size size) {
  const cv::Mat rgb(frame.height, frame.width, CV_8UC3, const_cast<uint8_t*>(frame.pixels.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  cv::copyMakeBorder(bgr, bgr, 0, size.height - frame.height, 0, size.width - frame.width,
                     cv::BORDER_REPLICATE);
  return bgr;
}

// Whether an MP4 is complete: its boxes (length, name, contents) end at the end of the file and
// include the index "moov", which FFmpeg writes last. OpenCV does not report failed writes.
bool is_whole(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const uint64_t size = std::filesystem::file_size(file);
  bool has_index = false;
  uint64_t at = 0;
  while (at < size) {
    uint8_t head[16] = {};
    in.seekg(std::streamoff(at));
    in.read(reinterpret_cast<char*>(head), size - at < 16 ? 8 : 16);
    if (!in) return false;
    const auto number = [&](int first, int bytes) {  // big-endian
      uint64_t value = 0;
      for (int i = first; i < first + bytes; ++i) value = value << 8 | head[i];
      return value;
    };
    const uint64_t length = number(0, 4) == 1 ? number(8, 8) : number(0, 4);
    if (length < 8 || length > size - at) return false;
    has_index |= std::memcmp(head + 4, "moov", 4) == 0;
    at += length;
  }
  return has_index;
}

}  // namespace

void write_movie(const std::string& path, size_t count, const std::function<Image(size_t)>& frame,
                 double fps) {
  if (count == 0) throw Error(fmt::format("cannot write video {}: there are no frames", path));
  if (!(float(fps) >= float(slowest_fps) && fps <= fastest_fps))  // settings are floats
    throw Error(fmt::format("cannot write video {}: {} frames per second, expected {} to {}", path,
                            fps, slowest_fps, fastest_fps));
  Image image = frame(0);
  const int width = image.width, height = image.height;
  const cv::Size size(width + width % 2, height + height % 2);
  replace_file(path, [&](const std::string& temporary) {
    cv::VideoWriter writer = open_writer(temporary, path, fps, size);
    for (size_t i = 0; i < count; ++i) {
      if (i > 0) image = frame(i);
      if (image.channels != 3 || image.width != width || image.height != height ||
          image.pixels.size() != 3 * size_t(width) * size_t(height))
        throw Error(
            fmt::format("cannot write video {}: its frames must be RGB and of equal size", path));
      writer.write(encodable(image, size));
    }
    writer.release();
    if (is_whole(temporary)) return;
    require_room(temporary, path);
    throw Error(fmt::format("cannot write video {}: FFmpeg did not write all of it", path));
  });
}

}  // namespace gflow
