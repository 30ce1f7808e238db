// SPDX-License-Identifier: Apache-2.0
#include "optim/images/video_stream.hpp"

extern "C" {
#include <libavutil/display.h>
#include <libavutil/opt.h>
}
#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <mutex>
#include <set>
#include <thread>

#include "optim/images/image_header.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/descriptor.hpp"
#include "runtime/files/is_zip.hpp"

namespace gflow {
namespace {

// Containers that hold the frames themselves. FFmpeg also opens playlists.
constexpr const char* kContainers =
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,mpegvideo,flv,ogg,asf,gif,apng,ivf,"
    "yuv4mpegpipe,h264,hevc,m4v,mjpeg,dv,mxf,nut,rm,vc1,obu,av1";
// Longest wait for one packet of a file [s].
constexpr int kPatience = 60;
// Decoding threads per video; scenes have many videos.
constexpr int kThreads = 4;

// Warns once per file.
bool is_first_damage(const std::string& path) {
  static std::mutex mutex;
  static std::set<std::string> reported;
  const std::lock_guard<std::mutex> lock(mutex);
  return reported.insert(path).second;
}

// VP8 and VP9 hold alpha in a second picture, which only libvpx reads.
const AVCodec* decoder_for(const AVStream& stream, bool& alpha_lost) {
  const AVCodecID id = stream.codecpar->codec_id;
  const AVDictionaryEntry* mode = av_dict_get(stream.metadata, "alpha_mode", nullptr, 0);
  const bool alpha = mode && std::strcmp(mode->value, "1") == 0;
  const char* const name = id == AV_CODEC_ID_VP9   ? "libvpx-vp9"
                           : id == AV_CODEC_ID_VP8 ? "libvpx"
                                                   : nullptr;
  if (alpha && name) {
    if (const AVCodec* codec = avcodec_find_decoder_by_name(name)) return codec;
    alpha_lost = true;
  }
  return avcodec_find_decoder(id);
}

// Side data of a stream; nullptr if there is none of that type or it is too short.
const uint8_t* side_data(const AVStream& stream, AVPacketSideDataType type, size_t size) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 102)
  const AVPacketSideData* data = av_packet_side_data_get(stream.codecpar->coded_side_data,
                                                         stream.codecpar->nb_coded_side_data, type);
  return data && data->size >= size ? data->data : nullptr;
#else
  size_t found = 0;
  const uint8_t* data = av_stream_get_side_data(&stream, type, &found);
  return data && found >= size ? data : nullptr;
#endif
}

}  // namespace

VideoStream::VideoStream(const std::string& path) : path_(path) {
  prepare_libav();
  if (!std::filesystem::is_regular_file(path)) fail("there is no such file");
  if (std::filesystem::file_size(path) == 0) fail("it is empty");
  // FFmpeg's words for a missing permission or too many open files are unclear.
  if (const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC)); file.get() < 0)
    fail(std::strerror(errno));
  try {
    open(path);
  } catch (...) {
    decoder_.reset();
    avformat_close_input(&file_);
    throw;
  }
}

VideoStream::~VideoStream() {
  decoder_.reset();  // logs to messages_ until then
  avformat_close_input(&file_);
}

void VideoStream::fail(const std::string& why) const {
  throw Error(fmt::format("cannot read video {}: {}", path_, why));
}

int VideoStream::overdue(void* stream) {
  return std::chrono::steady_clock::now() > static_cast<VideoStream*>(stream)->deadline_;
}

void VideoStream::open(const std::string& path) {
  if (is_zip(path)) fail("it is a zip archive; unpack it first");  // FFmpeg may find images inside
  packet_.reset(av_packet_alloc());
  frame_.reset(av_frame_alloc());
  file_ = avformat_alloc_context();
  if (!packet_ || !frame_ || !file_) fail("out of memory");
  file_->opaque = &messages_;
  file_->interrupt_callback = {overdue, this};
  deadline_ = std::chrono::steady_clock::now() + std::chrono::seconds(kPatience);
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  av_dict_set(&options, "format_whitelist", kContainers, 0);
  int code = avformat_open_input(&file_, ("file:" + path).c_str(), nullptr, &options);
  av_dict_free(&options);
  // Frees file_ on failure.
  const auto why = [&](int failed) {
    const std::string said = messages_.take();
    // The table of frames of an MP4 file, "moov", is usually at its end.
    if (said.find("moov atom not found") != said.npos)
      return std::string("the file seems cut off: its table of frames is missing");
    if (failed == AVERROR_INVALIDDATA || failed == AVERROR(EINVAL) || failed == AVERROR_EOF)
      return std::string("it is not a video that FFmpeg knows, or damaged");
    return libav_error(failed);
  };
  if (code < 0) fail("no frame could be read; " + why(code));
  code = avformat_find_stream_info(file_, nullptr);
  if (code < 0) fail("no frame could be read; " + why(code));
  const int best = av_find_best_stream(file_, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (best < 0) fail("it has no video stream");
  for (unsigned i = 0; i < file_->nb_streams; ++i)
    if (int(i) != best) file_->streams[i]->discard = AVDISCARD_ALL;
  stream_ = file_->streams[best];

  bool alpha_lost = false;
  const AVCodec* codec = decoder_for(*stream_, alpha_lost);
  const char* const name = avcodec_get_name(stream_->codecpar->codec_id);
  if (!codec) fail(fmt::format("this FFmpeg has no decoder for {}", name));
  if (alpha_lost)
    warn(fmt::format("the alpha of video {} is not read: this FFmpeg has no libvpx", path_));
  decoder_.reset(avcodec_alloc_context3(codec));
  if (!decoder_) fail("out of memory");
  code = avcodec_parameters_to_context(decoder_.get(), stream_->codecpar);
  if (code < 0) fail(libav_error(code));
  decoder_->opaque = &messages_;
  decoder_->pkt_timebase = stream_->time_base;
  decoder_->max_pixels = int64_t(largest_side) * largest_side;
  const int cores = int(std::max(std::thread::hardware_concurrency(), 1u));
  decoder_->thread_count = std::min(cores, kThreads);
  code = avcodec_open2(decoder_.get(), codec, nullptr);
  if (code < 0) fail(fmt::format("its {} stream cannot be decoded: {}", name, why(code)));
}

void VideoStream::note_damage(int64_t stamp, int code) {
  const std::string said = messages_.take();
  if (!is_first_damage(path_)) return;
  const std::string place =
      stamp == AV_NOPTS_VALUE
          ? ""
          : fmt::format(" near {:.3f} s", double(stamp) * av_q2d(stream_->time_base));
  warn(fmt::format("video {} is damaged{}: its decoder reports '{}'; its frames may be wrong",
                   path_, place, said.empty() ? libav_error(code) : said));
}

// Sends the next packet to the decoder; false if there are no more.
bool VideoStream::feed() {
  if (ended_) return false;
  deadline_ = std::chrono::steady_clock::now() + std::chrono::seconds(kPatience);
  const int code = av_read_frame(file_, packet_.get());
  if (code < 0) {
    ended_ = true;
    if (code == AVERROR_EXIT) fail(fmt::format("nothing could be read for {} seconds", kPatience));
    if (code != AVERROR_EOF) note_damage(sent_, code);
    avcodec_send_packet(decoder_.get(), nullptr);  // the decoder's last frames
    return true;
  }
  if (packet_->stream_index == stream_->index) {
    if (packet_->pts != AV_NOPTS_VALUE) sent_ = packet_->pts;
    const int sent = avcodec_send_packet(decoder_.get(), packet_.get());
    if (sent == AVERROR(ENOMEM)) fail("out of memory");
    if (sent < 0 && sent != AVERROR_EOF) note_damage(sent_, sent);
  }
  av_packet_unref(packet_.get());
  return true;
}

bool VideoStream::next() {
  for (;;) {
    const int code = avcodec_receive_frame(decoder_.get(), frame_.get());
    if (code == 0) {
      if (frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT))
        note_damage(frame_->best_effort_timestamp, AVERROR_INVALIDDATA);
      return true;
    }
    if (code == AVERROR_EOF) return false;
    if (code == AVERROR(ENOMEM)) fail("out of memory");
    if (code != AVERROR(EAGAIN)) note_damage(sent_, code);
    if (!feed()) return false;
  }
}

double VideoStream::time() const {
  const int64_t stamp = frame_->best_effort_timestamp;
  return stamp == AV_NOPTS_VALUE ? std::nan("") : double(stamp) * av_q2d(stream_->time_base);
}

Orientation VideoStream::orientation() const {
  const uint8_t* matrix = side_data(*stream_, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(int32_t));
  if (!matrix) return {};
  int32_t values[9];
  std::memcpy(values, matrix, sizeof values);
  return orientation_of(values);
}

// The container's aspect wins over the codec's, as in the ffmpeg program.
AVRational VideoStream::pixel_aspect() const {
  return stream_->sample_aspect_ratio.num ? stream_->sample_aspect_ratio
                                          : stream_->codecpar->sample_aspect_ratio;
}

bool VideoStream::has_alpha() const {
  return gflow::has_alpha(AVPixelFormat(stream_->codecpar->format)) ||
         std::strncmp(decoder_->codec->name, "libvpx", 6) == 0;
}

int VideoStream::stated_frames() const {
  // The index of MP4 files knows what an edit list cuts away.
  const int entries = avformat_index_get_entries_count(stream_);
  int shown = 0;
  for (int i = 0; i < entries; ++i)
    shown += !(avformat_index_get_entry(stream_, i)->flags & AVINDEX_DISCARD_FRAME);
  const bool is_mp4 = std::strstr(file_->iformat->name, "mp4") != nullptr;
  const int64_t stated = is_mp4 && shown > 0 ? shown : stream_->nb_frames;
  return stated >= 1 && stated < 10000000 ? int(stated) : 0;
}

double VideoStream::stated_seconds() const {
  if (stream_->duration > 0) return double(stream_->duration) * av_q2d(stream_->time_base);
  // Matroska: "00:00:04.000000000".
  const AVDictionaryEntry* tag = av_dict_get(stream_->metadata, "DURATION", nullptr, 0);
  int hours = 0, minutes = 0;
  double seconds = 0;
  const bool known =
      tag && std::sscanf(tag->value, "%d:%d:%lf", &hours, &minutes, &seconds) == 3 && hours >= 0;
  return known && std::isfinite(seconds) ? 3600. * hours + 60. * minutes + seconds : 0;
}

std::vector<double> VideoStream::packet_times() {
  std::vector<double> times;
  for (;;) {
    deadline_ = std::chrono::steady_clock::now() + std::chrono::seconds(kPatience);
    if (av_read_frame(file_, packet_.get()) < 0) break;
    const bool shown = !(packet_->flags & AV_PKT_FLAG_DISCARD);
    if (packet_->stream_index == stream_->index && shown)
      times.push_back(packet_->pts == AV_NOPTS_VALUE
                          ? std::nan("")
                          : double(packet_->pts) * av_q2d(stream_->time_base));
    av_packet_unref(packet_.get());
  }
  const auto stamped =
      std::partition(times.begin(), times.end(), [](double time) { return !std::isnan(time); });
  std::sort(times.begin(), stamped);
  return times;
}

Image VideoStream::image() {
  return converter_.image(*frame_, pixel_aspect(), orientation(), path_);
}

}  // namespace gflow
