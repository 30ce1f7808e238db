// SPDX-License-Identifier: Apache-2.0
// Video files through OpenCV.
#include "optim/images/video.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>
#include <set>

#include "optim/images/decoder_log.hpp"
#include "optim/images/image_header.hpp"
#include "optim/images/movie.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/descriptor.hpp"

namespace gflow {
namespace {

// FFmpeg also opens playlists, text files that name other files anywhere. The whitelist admits only
// containers that hold the frames themselves.
void refuse_playlists() {
  static const int set =
      ::setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS",
               "protocol_whitelist;file|format_whitelist;mov,mp4,m4a,3gp,3g2,mj2,"
               "matroska,webm,avi,mpeg,mpegts,mpegvideo,flv,ogg,asf,gif,apng,ivf,"
               "yuv4mpegpipe,h264,hevc,m4v,mjpeg,dv,mxf,nut,rm,vc1,obu,av1",
               0);
  (void)set;
}

// FFmpeg allocates tables of the length stated in a header before it reads them: a 2 kB video asked
// for 1.7 GB. The limit of 768 MB holds a frame of 16000 x 16000. FFmpeg is not linked directly,
// only through OpenCV if that was built with it.
void limit_memory_of_ffmpeg() {
  static const bool done = [] {
    void* const limit = dlsym(RTLD_DEFAULT, "av_max_alloc");
    if (limit) reinterpret_cast<void (*)(size_t)>(limit)(size_t{768} << 20);
    return true;
  }();
  (void)done;
}

// Held while a video is opened or decoded. One thread at a time, because FFmpeg's messages do not
// name the file. Decoding runs some frames ahead, so a message belongs to the last video used.
// Decoders continue after damage with wrong frames; this warns once per file.
class Turn {
 public:
  explicit Turn(const std::string& path) : lock_(mutex()) {
    report();
    last() = path;
  }
  ~Turn() { report(); }
  // The first message about a file that could not be opened; none is reported later, because the
  // caller throws an Error.
  std::string refused() {
    last().clear();
    return take_decoder_error();
  }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  static std::string& last() {
    static std::string path;
    return path;
  }
  static void report() {
    static std::set<std::string> reported;
    const std::string complaint = take_decoder_error();
    if (complaint.empty() || last().empty() || !reported.insert(last()).second) return;
    warn(fmt::format("video {} is damaged: its decoder reports '{}'; its frames may be wrong",
                     last(), complaint));
  }
  std::lock_guard<std::mutex> lock_;
};

cv::VideoCapture open_video(const std::string& path) {
  refuse_playlists();
  limit_memory_of_ffmpeg();
  if (!std::filesystem::is_regular_file(path))
    throw Error(fmt::format("cannot read video {}: there is no such file", path));
  if (std::filesystem::file_size(path) == 0)
    throw Error(fmt::format("cannot read video {}: it is empty", path));
  Turn turn(path);
  cv::VideoCapture capture;
  bool ok = false;
  try {
    // Prefer FFmpeg: other backends seek and count frames less exactly.
    const bool ffmpeg = cv::videoio_registry::hasBackend(cv::CAP_FFMPEG);
    ok = capture.open(path, ffmpeg ? cv::CAP_FFMPEG : cv::CAP_ANY);
  } catch (const cv::Exception&) {
    // Reported below.
  }
  if (ok) return capture;
  const std::string complaint = turn.refused();
  // A missing permission or too many open files are not damage.
  if (const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC)); file.get() < 0)
    throw Error(fmt::format("cannot read video {}: {}", path, std::strerror(errno)));
  // The table of frames of an MP4 file, "moov", is usually at its end.
  const bool cut_off = complaint.find("moov atom not found") != complaint.npos;
  throw Error(fmt::format(
      "cannot read video {}: no frame could be read; {}", path,
      cut_off ? "the file seems cut off: its table of frames is missing"
              : "the file seems cut off, OpenCV cannot decode it, or memory or threads ran out"));
}

// Decodes the next frame; false at the end.
bool grab(cv::VideoCapture& capture, const std::string& path) {
  const Turn turn(path);
  try {
    return capture.grab();
  } catch (const cv::Exception&) {
    return false;  // damaged data count as the end
  }
}

}  // namespace

VideoInfo video_info(const std::string& path) {
  cv::VideoCapture capture = open_video(path);
  VideoInfo info;
  info.width = int(capture.get(cv::CAP_PROP_FRAME_WIDTH));
  info.height = int(capture.get(cv::CAP_PROP_FRAME_HEIGHT));
  info.fps = capture.get(cv::CAP_PROP_FPS);
  const double stated = capture.get(cv::CAP_PROP_FRAME_COUNT);
  if (stated >= 1 && stated < 1e7)
    info.frames = int(stated);
  else
    while (grab(capture, path)) ++info.frames;
  const bool sized = info.width > 0 && info.height > 0 && info.width <= largest_side &&
                     info.height <= largest_side;
  if (!sized || info.frames == 0)
    throw Error(fmt::format("cannot read video {}: it has {} frames of {}x{}", path, info.frames,
                            info.width, info.height));
  if (!(info.fps >= slowest_fps && info.fps <= fastest_fps)) info.fps = 24;
  return info;
}

std::vector<double> frame_times(const std::string& path, int limit) {
  const VideoInfo info = video_info(path);
  cv::VideoCapture capture = open_video(path);
  std::vector<double> times;
  bool rising = true;
  while ((limit <= 0 || int(times.size()) < limit) && grab(capture, path)) {
    // Time stamps are relative to the first frame, whose own stamp is not always available.
    const double stamp = times.empty() ? 0 : 1e-3 * capture.get(cv::CAP_PROP_POS_MSEC);
    rising &= times.empty() || stamp > times.back();
    times.push_back(stamp);
  }
  if (times.empty())
    throw Error(
        fmt::format("cannot read video {}: no frame could be read; the file seems cut off", path));
  if (!rising)
    for (size_t k = 0; k < times.size(); ++k) times[k] = double(k) / info.fps;
  return times;
}

struct Video::State {
  std::string path;
  cv::VideoCapture capture;
  int next = 0;  // index of the next frame to grab
};

Video::Video(const std::string& path) : state_(new State{path, open_video(path), 0}) {}
Video::~Video() = default;
Video::Video(Video&&) noexcept = default;
Video& Video::operator=(Video&&) noexcept = default;

Image Video::frame(int k) {
  if (k < state_->next) {
    state_->capture = open_video(state_->path);
    state_->next = 0;
  }
  for (; state_->next <= k; ++state_->next)
    if (!grab(state_->capture, state_->path))
      throw Error(
          fmt::format("cannot read video {}: only {} frames could be read, but frame {} is needed; "
                      "the file seems cut off",
                      state_->path, state_->next, k + 1));
  cv::Mat bgr, rgb;
  try {
    state_->capture.retrieve(bgr);
  } catch (const cv::Exception&) {
    // bgr stays empty, which is reported below.
  }
  if (bgr.empty() || bgr.type() != CV_8UC3)
    throw Error(fmt::format("cannot decode frame {} of video {}", k, state_->path));
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  Image image{rgb.cols, rgb.rows, 3, {}};
  image.pixels.assign(rgb.data, rgb.data + rgb.total() * 3);
  return image;
}

}  // namespace gflow
