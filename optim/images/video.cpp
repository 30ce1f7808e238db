// SPDX-License-Identifier: Apache-2.0
#include "optim/images/video.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/images/image_header.hpp"
#include "optim/images/movie.hpp"
#include "optim/images/video_stream.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Matrix, range and HDR curve in words.
std::string colors_of(const AVCodecParameters& stream) {
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(AVPixelFormat(stream.format));
  if (format && (format->flags & AV_PIX_FMT_FLAG_RGB)) return "RGB";
  std::string words;
  switch (stream.color_space) {
    case AVCOL_SPC_BT709:
      words = "BT.709";
      break;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      words = "BT.601";
      break;
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
      words = "BT.2020";
      break;
    case AVCOL_SPC_UNSPECIFIED:
      words = "no matrix stated, BT.601 assumed";
      break;
    default:
      words =
          av_color_space_name(stream.color_space) ? av_color_space_name(stream.color_space) : "?";
  }
  words += stream.color_range == AVCOL_RANGE_JPEG ? ", full range" : ", limited range";
  if (stream.color_trc == AVCOL_TRC_SMPTE2084) words += ", HDR (PQ), tone mapped";
  if (stream.color_trc == AVCOL_TRC_ARIB_STD_B67) words += ", HDR (HLG), shown as it is";
  return words;
}

// Whether the intervals between frames differ by more than the rounding of time stamps, which are
// milliseconds in Matroska. False if stamps are missing.
bool is_variable_rate(const std::vector<double>& times) {
  double least = 1e30, most = 0;
  for (size_t k = 1; k < times.size(); ++k) {
    if (std::isnan(times[k])) return false;
    least = std::min(least, times[k] - times[k - 1]);
    most = std::max(most, times[k] - times[k - 1]);
  }
  return most - least > 2.5e-3;
}

bool is_transparent(const Image& image) {
  for (size_t i = 3; i < image.pixels.size() && image.channels == 4; i += 4)
    if (image.pixels[i] < 255) return true;
  return false;
}

}  // namespace

VideoInfo video_info(const std::string& path) {
  VideoStream video(path);
  const AVStream& stream = video.stream();
  const AVCodecParameters& codec = *stream.codecpar;
  const Orientation turn = video.orientation();
  const ShownSize size = shown_size(codec.width, codec.height, video.pixel_aspect(), turn);
  VideoInfo info;
  info.width = size.width;
  info.height = size.height;
  info.stored_width = codec.width;
  info.stored_height = codec.height;
  const AVRational aspect = video.pixel_aspect();
  info.pixel_aspect = aspect.num > 0 && aspect.den > 0 ? av_q2d(aspect) : 1;
  info.rotation = turn.degrees();
  info.mirrored = turn.is_mirrored();
  info.interlaced =
      codec.field_order != AV_FIELD_UNKNOWN && codec.field_order != AV_FIELD_PROGRESSIVE;
  info.codec = avcodec_get_name(codec.codec_id);
  if (const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(AVPixelFormat(codec.format)))
    info.bits = format->comp[0].depth;
  info.colors = colors_of(codec);
  info.fps = av_q2d(stream.avg_frame_rate.num > 0 ? stream.avg_frame_rate : stream.r_frame_rate);
  if (!(info.fps >= slowest_fps && info.fps <= fastest_fps)) info.fps = 24;
  info.seconds = video.stated_seconds();
  info.times = VideoStream(path).packet_times();
  const int packets = int(info.times.size()), stated = video.stated_frames();
  info.frames = stated > 0 && packets > 0 ? std::min(stated, packets) : std::max(stated, packets);
  info.variable = is_variable_rate(info.times);
  if (!info.times.empty() && std::isnan(info.times.back())) info.times.clear();  // NaN comes last
  for (size_t k = info.times.size(); k-- > 0;) info.times[k] -= info.times[0];
  info.alpha = video.has_alpha() && video.next() && is_transparent(video.image());
  const bool sized = codec.width > 0 && codec.height > 0 && info.width <= largest_side &&
                     info.height <= largest_side;
  if (!sized || info.frames == 0)
    throw Error(
        fmt::format("cannot read video {}: it has {} frames of {}x{} pixels, expected at "
                    "least one and sides of at most {}",
                    path, info.frames, info.width, info.height, largest_side));
  return info;
}

std::vector<double> frame_times(const std::string& path, int limit) {
  VideoStream video(path);
  std::vector<double> times;
  bool rising = true;
  double first = 0;
  while ((limit <= 0 || int(times.size()) < limit) && video.next()) {
    const double stamp = video.time();
    if (times.empty()) first = stamp;
    rising &= !std::isnan(stamp) && (times.empty() || stamp - first > times.back());
    times.push_back(stamp - first);
  }
  if (times.empty())
    throw Error(
        fmt::format("cannot read video {}: no frame could be read; the file seems cut off", path));
  if (!rising) {
    const double fps = video_info(path).fps;
    warn_once(
        fmt::format("the time stamps of video {} do not increase: its frames are taken to be "
                    "1/{:.5g} s apart",
                    path, fps));
    for (size_t k = 0; k < times.size(); ++k) times[k] = double(k) / fps;
  }
  return times;
}

class Video::State {
 public:
  explicit State(const std::string& path) : path(path), stream(new VideoStream(path)) {}

  std::string path;
  std::unique_ptr<VideoStream> stream;
  int next = 0;  // index of the next frame to decode
};

Video::Video(const std::string& path) : state_(new State(path)) {}
Video::~Video() = default;
Video::Video(Video&&) noexcept = default;
Video& Video::operator=(Video&&) noexcept = default;

Image Video::frame(int k) {
  if (k < state_->next - 1) {  // the last one is still there
    state_->stream = std::make_unique<VideoStream>(state_->path);
    state_->next = 0;
  }
  for (; state_->next <= k; ++state_->next)
    if (!state_->stream->next())
      throw Error(
          fmt::format("cannot read video {}: only {} frames could be read, but frame {} is needed; "
                      "the file seems cut off",
                      state_->path, state_->next, k + 1));
  return state_->stream->image();
}

}  // namespace gflow
