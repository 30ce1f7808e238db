// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <png.h>

#include <csetjmp>
#include <cstdio>
#include <cstring>

#include "optim/images/decoded_image.hpp"

namespace gflow {
namespace {

// Error handler for libpng; keeps its first message.
struct PngReport {
  std::jmp_buf stop;
  char words[200] = "";
};

void keep_words(png_structp png, png_const_charp words) {
  PngReport& report = *static_cast<PngReport*>(png_get_error_ptr(png));
  if (!report.words[0]) std::snprintf(report.words, sizeof report.words, "%s", words);
}

[[noreturn]] void on_error(png_structp png, png_const_charp words) {
  keep_words(png, words);
  std::longjmp(static_cast<PngReport*>(png_get_error_ptr(png))->stop, 1);
}

struct PngSource {
  const Bytes& bytes;
  size_t at;
};

void read_source(png_structp png, png_bytep to, size_t n) {
  PngSource& source = *static_cast<PngSource*>(png_get_io_ptr(png));
  if (source.bytes.size() - source.at < n) png_error(png, "it is too short");
  std::memcpy(to, source.bytes.data() + source.at, n);
  source.at += n;
}

void swap_on_little_endian(png_structp png) {  // PNG stores 16 bits big-endian
  const uint16_t one = 1;
  uint8_t first = 0;
  std::memcpy(&first, &one, 1);
  if (first == 1) png_set_swap(png);
}

// Sets the conversion of each colour type.
void ask_for_channels(png_structp png, png_infop info) {
  const int kind = png_get_color_type(png, info);
  const bool colours = (kind & PNG_COLOR_MASK_COLOR) != 0;
  if (kind == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  if (colours && png_get_valid(png, info, PNG_INFO_tRNS)) png_set_tRNS_to_alpha(png);
  if (kind == PNG_COLOR_TYPE_GRAY) png_set_expand_gray_1_2_4_to_8(png);
  if (kind == PNG_COLOR_TYPE_GRAY_ALPHA) png_set_gray_to_rgb(png);
  swap_on_little_endian(png);
}

// No local object may need a destructor: errors leave this function by longjmp.
bool decode(png_structp png, png_infop info, PngReport& report, DecodedImage& to) {
  if (setjmp(report.stop)) return false;
  // Of the ancillary chunks only tRNS is used. Checksums were verified by check_image_bytes.
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_set_crc_action(png, PNG_CRC_QUIET_USE, PNG_CRC_QUIET_USE);
  png_read_info(png, info);
  ask_for_channels(png, info);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  to.width = int(png_get_image_width(png, info));
  to.height = int(png_get_image_height(png, info));
  to.channels = png_get_channels(png, info);
  to.bits = png_get_bit_depth(png, info);
  to.pixels.resize(size_t(to.height) * to.row());
  for (int pass = 0; pass < passes; ++pass)
    for (int y = 0; y < to.height; ++y)
      png_read_row(png, to.pixels.data() + size_t(y) * to.row(), nullptr);
  return true;
}

void append(png_structp png, png_bytep from, size_t n) {
  Bytes& bytes = *static_cast<Bytes*>(png_get_io_ptr(png));
  bytes.insert(bytes.end(), from, from + n);
}

// As decode(). Fast settings, which suit renders: they are written by the hundred.
bool encode(png_structp png, png_infop info, PngReport& report, const PngPixels& image) {
  if (setjmp(report.stop)) return false;
  const int kind = image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                   : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                         : PNG_COLOR_TYPE_RGB_ALPHA;
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png, 1);
  png_set_compression_strategy(png, 3);  // runs of equal bytes
  png_set_IHDR(png, info, png_uint_32(image.width), png_uint_32(image.height), image.bits, kind,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (image.bits == 16) swap_on_little_endian(png);
  const size_t row = size_t(image.width) * size_t(image.channels) * size_t(image.bits / 8);
  for (int y = 0; y < image.height; ++y) png_write_row(png, image.pixels + size_t(y) * row);
  png_write_end(png, info);
  return true;
}

}  // namespace

Bytes encode_png(const PngPixels& image) {
  PngReport report;
  Bytes bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &report, on_error, keep_words);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  if (info) png_set_write_fn(png, &bytes, append, nullptr);
  const bool done = info && encode(png, info, report, image);
  png_destroy_write_struct(&png, &info);
  if (!done)
    throw Error(fmt::format("cannot encode a PNG of {} x {} pixels: {}", image.width, image.height,
                            report.words));
  return bytes;
}

DecodedImage decode_png(const Bytes& bytes) {
  PngReport report;
  PngSource source{bytes, 0};
  DecodedImage result;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &report, on_error, keep_words);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  if (info) {
    png_set_read_fn(png, &source, read_source);
    if (!decode(png, info, report, result)) result.pixels.clear();
  }
  png_destroy_read_struct(&png, &info, nullptr);
  result.complaint = report.words;
  return result;
}

}  // namespace gflow
