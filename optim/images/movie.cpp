// SPDX-License-Identifier: Apache-2.0
#include "optim/images/movie.hpp"

extern "C" {
#include <libavutil/opt.h>
}
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "optim/images/libav.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// An MP4 file while it is written.
class Encoder {
 public:
  // shown: the path for messages.
  Encoder(const std::string& file, const std::string& shown, double fps, int width, int height)
      : file_(file), shown_(shown), packet_(av_packet_alloc()), frame_(av_frame_alloc()) {
    prepare_libav();
    try {
      open(fps, width, height);
    } catch (...) {
      close();
      throw;
    }
  }
  ~Encoder() { close(); }
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  void add(const Image& rgb) {
    require(av_frame_make_writable(frame_.get()));
    const std::vector<uint8_t> even = rows_of(rgb);
    const uint8_t* const planes[] = {even.data()};
    const int strides[] = {3 * frame_->width};
    sws_scale(scaler_.get(), planes, strides, 0, frame_->height, frame_->data, frame_->linesize);
    frame_->pts = next_++;
    require(avcodec_send_frame(codec_.get(), frame_.get()));
    write_packets();
  }

  void finish() {
    require(avcodec_send_frame(codec_.get(), nullptr));
    write_packets();
    require(av_write_trailer(muxer_));
    require(avio_closep(&muxer_->pb));
  }

 private:
  void require(int code) const {
    if (code >= 0) return;
    require_room(file_, shown_);
    throw Error(fmt::format("cannot write video {}: {}", shown_, libav_error(code)));
  }

  void open(double fps, int width, int height) {
    if (!packet_ || !frame_) require(AVERROR(ENOMEM));
    require(avformat_alloc_output_context2(&muxer_, nullptr, "mp4", file_.c_str()));
    // H.264 plays everywhere; MPEG-4 is always built in.
    for (const AVCodecID id : {AV_CODEC_ID_H264, AV_CODEC_ID_MPEG4})
      if (open_encoder(avcodec_find_encoder(id), fps, width, height)) break;
    if (!codec_)
      throw Error(fmt::format("cannot write video {}: this FFmpeg has no MP4 encoder", shown_));
    AVStream* stream = avformat_new_stream(muxer_, nullptr);
    if (!stream) require(AVERROR(ENOMEM));
    stream->time_base = codec_->time_base;
    stream->avg_frame_rate = codec_->framerate;
    require(avcodec_parameters_from_context(stream->codecpar, codec_.get()));
    require(avio_open(&muxer_->pb, ("file:" + file_).c_str(), AVIO_FLAG_WRITE));
    require(avformat_write_header(muxer_, nullptr));

    frame_->format = codec_->pix_fmt;
    frame_->width = width;
    frame_->height = height;
    require(av_frame_get_buffer(frame_.get(), 0));
    scaler_.reset(sws_getContext(width, height, AV_PIX_FMT_RGB24, width, height, codec_->pix_fmt,
                                 SWS_BICUBIC | SWS_ACCURATE_RND, nullptr, nullptr, nullptr));
    if (!scaler_) require(AVERROR(ENOMEM));
    const int* const matrix = sws_getCoefficients(SWS_CS_ITU709);
    sws_setColorspaceDetails(scaler_.get(), matrix, 1, matrix, 0, 0, 1 << 16, 1 << 16);
  }

  bool open_encoder(const AVCodec* encoder, double fps, int width, int height) {
    if (!encoder) return false;
    LibavPointer<AVCodecContext> codec(avcodec_alloc_context3(encoder));
    if (!codec) require(AVERROR(ENOMEM));
    codec->width = width;
    codec->height = height;
    codec->pix_fmt = AV_PIX_FMT_YUV420P;
    codec->framerate = av_d2q(fps, 60000);  // MPEG-4 has no finer time base
    codec->time_base = av_inv_q(codec->framerate);
    codec->colorspace = AVCOL_SPC_BT709;
    codec->color_primaries = AVCOL_PRI_BT709;
    codec->color_trc = AVCOL_TRC_BT709;
    codec->color_range = AVCOL_RANGE_MPEG;
    codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_QSCALE;
    codec->global_quality = 3 * FF_QP2LAMBDA;      // of MPEG-4
    av_opt_set(codec->priv_data, "crf", "17", 0);  // of libx264: hardly visible loss
    av_opt_set(codec->priv_data, "preset", "veryfast", 0);
    if (avcodec_open2(codec.get(), encoder, nullptr) < 0) return false;
    codec_ = std::move(codec);
    return true;
  }

  // RGB rows of even sides; the last row and column are repeated.
  std::vector<uint8_t> rows_of(const Image& rgb) const {
    const size_t width = size_t(frame_->width), height = size_t(frame_->height);
    std::vector<uint8_t> rows(3 * width * height);
    for (size_t y = 0; y < height; ++y) {
      const uint8_t* from =
          &rgb.pixels[3 * std::min(y, size_t(rgb.height) - 1) * size_t(rgb.width)];
      uint8_t* to = &rows[3 * y * width];
      std::copy_n(from, 3 * rgb.width, to);
      for (size_t x = size_t(rgb.width); x < width; ++x) std::copy_n(to + 3 * x - 3, 3, to + 3 * x);
    }
    return rows;
  }

  void write_packets() {
    for (;;) {
      const int code = avcodec_receive_packet(codec_.get(), packet_.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
      require(code);
      if (packet_->duration == 0) packet_->duration = 1;
      av_packet_rescale_ts(packet_.get(), codec_->time_base, muxer_->streams[0]->time_base);
      require(av_interleaved_write_frame(muxer_, packet_.get()));
    }
  }

  void close() {
    if (muxer_) avio_closep(&muxer_->pb);
    avformat_free_context(muxer_);
    muxer_ = nullptr;
  }

  std::string file_, shown_;
  AVFormatContext* muxer_ = nullptr;
  LibavPointer<AVPacket> packet_;
  LibavPointer<AVFrame> frame_;
  LibavPointer<AVCodecContext> codec_;
  LibavPointer<SwsContext> scaler_;
  int64_t next_ = 0;
};

}  // namespace

void write_movie(const std::string& path, size_t count, const std::function<Image(size_t)>& frame,
                 double fps) {
  if (count == 0) throw Error(fmt::format("cannot write video {}: there are no frames", path));
  if (!(float(fps) >= float(slowest_fps) && fps <= fastest_fps))  // settings are floats
    throw Error(fmt::format("cannot write video {}: {} frames per second, expected {} to {}", path,
                            fps, slowest_fps, fastest_fps));
  Image image = frame(0);
  const int width = image.width, height = image.height;
  replace_file(path, [&](const std::string& temporary) {
    Encoder encoder(temporary, path, fps, width + width % 2, height + height % 2);
    for (size_t i = 0; i < count; ++i) {
      if (i > 0) image = frame(i);
      if (image.channels != 3 || image.width != width || image.height != height ||
          image.pixels.size() != 3 * size_t(width) * size_t(height))
        throw Error(
            fmt::format("cannot write video {}: its frames must be RGB and of equal size", path));
      encoder.add(image);
    }
    encoder.finish();
  });
}

}  // namespace gflow
