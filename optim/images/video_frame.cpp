// SPDX-License-Identifier: Apache-2.0
#include "optim/images/video_frame.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/images/image_header.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Pixels of `channels` bytes, turned and mirrored.
std::vector<uint8_t> turned(const std::vector<uint8_t>& pixels, int width, int height, int channels,
                            const Orientation& turn, const ShownSize& size) {
  std::vector<uint8_t> out(pixels.size());
  // x' = across x + down y, measured from the middle in half pixels, so that it is exact.
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int cx = 2 * x + 1 - width, cy = 2 * y + 1 - height;
      const int to_x = (turn.across[0] * cx + turn.down[0] * cy + size.width - 1) / 2;
      const int to_y = (turn.across[1] * cx + turn.down[1] * cy + size.height - 1) / 2;
      const size_t from = (size_t(y) * size_t(width) + size_t(x)) * size_t(channels);
      const size_t to = (size_t(to_y) * size_t(size.width) + size_t(to_x)) * size_t(channels);
      std::copy_n(&pixels[from], channels, &out[to]);
    }
  return out;
}

// Whether pixels of a frame with a palette are transparent. Unused colours may be zero.
bool has_transparent_palette(const AVFrame& frame) {
  if (frame.format != AV_PIX_FMT_PAL8 || !frame.data[1]) return false;
  const auto* palette = reinterpret_cast<const uint32_t*>(frame.data[1]);  // ARGB
  for (int y = 0; y < frame.height; ++y) {
    const uint8_t* row = frame.data[0] + ptrdiff_t(y) * frame.linesize[0];
    if (std::any_of(row, row + frame.width, [&](uint8_t at) { return palette[at] >> 24 < 255; }))
      return true;
  }
  return false;
}

bool is_full_range(const AVFrame& frame) {
  const auto format = AVPixelFormat(frame.format);
  return frame.color_range == AVCOL_RANGE_JPEG || format == AV_PIX_FMT_YUVJ420P ||
         format == AV_PIX_FMT_YUVJ422P || format == AV_PIX_FMT_YUVJ444P ||
         format == AV_PIX_FMT_YUVJ440P || format == AV_PIX_FMT_YUVJ411P;
}

int matrix_of(const AVFrame& frame) {
  return frame.colorspace == AVCOL_SPC_UNSPECIFIED ? SWS_CS_DEFAULT : int(frame.colorspace);
}

// Perceptual quantizer, SMPTE ST 2084: code value in [0, 1] from and to light, 1 = 10000 cd/m2.
constexpr double kM1 = 2610. / 16384, kM2 = 2523. / 32, kC1 = 3424. / 4096, kC2 = 2413. / 128,
                 kC3 = 2392. / 128;
double light_of_pq(double code) {
  const double p = std::pow(code, 1 / kM2);
  return std::pow(std::max(p - kC1, 0.) / (kC2 - kC3 * p), 1 / kM1);
}
double pq_of_light(double light) {
  const double p = std::pow(light, kM1);
  return std::pow((kC1 + kC2 * p) / (1 + kC3 * p), kM2);
}

// Roll-off of ITU-R BT.2390, section 5.4.1, from a peak of 1000 cd/m2 to reference white, for a PQ
// code value; identity below the knee.
double rolled_off(double code) {
  static const double source = pq_of_light(1000. / 10000), target = pq_of_light(203. / 10000);
  const double most = target / source, knee = 1.5 * most - 0.5;
  const double e = std::min(code / source, 1.);
  if (e < knee) return code;
  const double t = (e - knee) / (1 - knee), t2 = t * t, t3 = t2 * t;
  return source * ((2 * t3 - 3 * t2 + 1) * knee + (t3 - 2 * t2 + t) * (1 - knee) +
                   (-2 * t3 + 3 * t2) * most);
}

double srgb_of_light(double x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

// Tables over 16-bit code values: light [x reference white], and the gain of the roll-off where
// that is the brightest channel.
struct PqTables {
  std::vector<float> light, gain, srgb;
  PqTables() : light(65536), gain(65536), srgb(4097) {
    for (size_t i = 0; i < light.size(); ++i) {
      const double code = double(i) / 65535, at = light_of_pq(code);
      light[i] = float(at * 10000 / 203);
      gain[i] = float(at > 0 ? light_of_pq(rolled_off(code)) / at : 1);
    }
    for (size_t i = 0; i < srgb.size(); ++i)
      srgb[i] = float(255 * srgb_of_light(double(i) / double(srgb.size() - 1)));
  }
};

uint8_t shown(const PqTables& tables, double light) {
  const double at = std::clamp(light, 0., 1.) * double(tables.srgb.size() - 1);
  const size_t i = std::min(size_t(at), tables.srgb.size() - 2);
  const double share = at - double(i);
  return uint8_t((1 - share) * double(tables.srgb[i]) + share * double(tables.srgb[i + 1]) + 0.5);
}

}  // namespace

int Orientation::degrees() const {
  if (across[0] == 1) return 0;
  if (across[1] == 1) return 90;
  return across[0] == -1 ? (is_mirrored() ? 0 : 180) : 270;
}

Orientation orientation_of(const int32_t* matrix) {
  // Row-major 3 x 3 with x' = a x + c y, y' = b x + d y for the rows (a b ...), (c d ...).
  const double a = matrix[0], b = matrix[1], c = matrix[3], d = matrix[4];
  const auto sign = [](double x) { return x < 0 ? -1 : 1; };
  Orientation turn;
  if (a == 0 && b == 0) return turn;
  const bool straight = std::abs(a) >= std::abs(b);
  turn.across = straight ? std::array{sign(a), 0} : std::array{0, sign(b)};
  turn.down = straight ? std::array{0, sign(d)} : std::array{sign(c), 0};
  return turn;
}

ShownSize shown_size(int width, int height, AVRational pixel_aspect, const Orientation& turn) {
  const double aspect = pixel_aspect.num > 0 && pixel_aspect.den > 0 ? av_q2d(pixel_aspect) : 1;
  const ShownSize square{std::max(int(std::lround(width * aspect)), 1), height};
  return turn.swaps_sides() ? ShownSize{square.height, square.width} : square;
}

bool has_alpha(AVPixelFormat format) {
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(format);
  return description && (description->flags & AV_PIX_FMT_FLAG_ALPHA) &&
         !(description->flags & AV_PIX_FMT_FLAG_PAL);
}

void tone_map_pq(const uint16_t* rgb, size_t pixels, uint8_t* out) {
  static const PqTables tables;
  for (size_t i = 0; i < pixels; ++i) {
    const uint16_t* p = &rgb[3 * i];
    const double gain = double(tables.gain[std::max({p[0], p[1], p[2]})]);
    const double r = gain * double(tables.light[p[0]]), g = gain * double(tables.light[p[1]]),
                 b = gain * double(tables.light[p[2]]);
    // BT.2020 to BT.709 primaries (ITU-R BT.2087).
    out[3 * i] = shown(tables, 1.6605 * r - 0.5876 * g - 0.0728 * b);
    out[3 * i + 1] = shown(tables, -0.1246 * r + 1.1329 * g - 0.0083 * b);
    out[3 * i + 2] = shown(tables, -0.0182 * r - 0.1006 * g + 1.1187 * b);
  }
}

Image FrameConverter::image(const AVFrame& frame, AVRational pixel_aspect, const Orientation& turn,
                            const std::string& path) {
  const auto format = AVPixelFormat(frame.format);
  const ShownSize size = shown_size(frame.width, frame.height, pixel_aspect, turn);
  if (frame.width < 1 || frame.height < 1 || std::max(size.width, size.height) > largest_side)
    throw Error(
        fmt::format("cannot read video {}: its frames are {}x{}", path, size.width, size.height));
  const bool hdr = frame.color_trc == AVCOL_TRC_SMPTE2084;
  const bool alpha = !hdr && (has_alpha(format) || has_transparent_palette(frame));
  const int width = turn.swaps_sides() ? size.height : size.width;  // before turning
  const int height = frame.height, channels = alpha ? 4 : 3;
  const AVPixelFormat to = hdr ? AV_PIX_FMT_RGB48 : alpha ? AV_PIX_FMT_RGBA : AV_PIX_FMT_RGB24;
  const int range = is_full_range(frame), matrix = matrix_of(frame);
  const std::array<int, 7> wanted{int(format), frame.width, height, width, range, matrix, int(to)};
  if (!scaler_ || format_ != wanted) {
    // The flags of the ffmpeg program, so that colours are equal to its.
    scaler_.reset(sws_getContext(frame.width, height, format, width, height, to, SWS_BICUBIC,
                                 nullptr, nullptr, nullptr));
    if (!scaler_)
      throw Error(fmt::format("cannot read video {}: its pixel format {} cannot be converted", path,
                              av_get_pix_fmt_name(format) ? av_get_pix_fmt_name(format) : "?"));
    const int* coefficients = sws_getCoefficients(matrix);
    // Fails for RGB frames, which need no matrix.
    sws_setColorspaceDetails(scaler_.get(), coefficients, range, coefficients, 1, 0, 1 << 16,
                             1 << 16);
    format_ = wanted;
  }
  // FFmpeg may write a few pixels beyond the end of a row.
  const size_t row = size_t(width) * size_t(channels) * (hdr ? 2 : 1);
  const size_t stride = (row + 127) / 64 * 64;
  std::vector<uint8_t> padded(stride * size_t(height));
  uint8_t* const planes[] = {padded.data()};
  const int strides[] = {int(stride)};
  if (sws_scale(scaler_.get(), frame.data, frame.linesize, 0, height, planes, strides) != height)
    throw Error(fmt::format("cannot read video {}: a frame cannot be converted to RGB", path));
  std::vector<uint8_t> pixels(size_t(width) * size_t(height) * size_t(channels));
  for (size_t y = 0; y < size_t(height); ++y) {
    const uint8_t* from = &padded[y * stride];
    uint8_t* to_row = &pixels[y * size_t(width) * size_t(channels)];
    if (hdr)
      tone_map_pq(reinterpret_cast<const uint16_t*>(from), size_t(width), to_row);
    else
      std::copy_n(from, row, to_row);
  }
  const bool upright = turn.across[0] == 1 && turn.down[1] == 1;
  if (!upright) pixels = turned(pixels, width, height, channels, turn, size);
  return {size.width, size.height, channels, std::move(pixels)};
}

}  // namespace gflow
