// SPDX-License-Identifier: Apache-2.0
// TIFF by libtiff's conversion to 8-bit RGBA, which knows every layout, compression and colour
// space that libtiff reads. Only the first image of a file is read.
#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <memory>

#include "optim/images/decoded_image.hpp"

namespace gflow {
namespace {

// A source as libtiff's file, and the first error that it reports.
struct TiffInput {
  ByteSource& source;
  size_t at = 0;
  char words[256] = "";
};

TiffInput& input_of(thandle_t handle) { return *static_cast<TiffInput*>(handle); }

tmsize_t read_input(thandle_t handle, void* to, tmsize_t n) {
  TiffInput& input = input_of(handle);
  const size_t size = input.source.size();
  const size_t count = std::min(size_t(n), size - std::min(input.at, size));
  if (!input.source.read(input.at, static_cast<uint8_t*>(to), count)) return 0;
  input.at += count;
  return tmsize_t(count);
}

tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek_input(thandle_t handle, toff_t offset, int from) {
  TiffInput& input = input_of(handle);
  const size_t base = from == SEEK_SET ? 0 : from == SEEK_CUR ? input.at : input.source.size();
  return input.at = base + offset;
}

int close_nothing(thandle_t) { return 0; }

toff_t input_size(thandle_t handle) { return input_of(handle).source.size(); }

int keep_error(TIFF*, void* input, const char*, const char* format, va_list arguments) {
  char* const words = static_cast<TiffInput*>(input)->words;
  if (!words[0]) std::vsnprintf(words, sizeof TiffInput::words, format, arguments);
  return 1;
}

int ignore_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct TiffClose {
  void operator()(TIFF* file) const { TIFFClose(file); }
};
using TiffPointer = std::unique_ptr<TIFF, TiffClose>;

TiffPointer open_tiff(TiffInput& input) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetErrorHandlerExtR(options, keep_error, &input);
  TIFFOpenOptionsSetWarningHandlerExtR(options, ignore_warning, nullptr);
  // Tables of the length that a header states are allocated before they are read.
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, tmsize_t{768} << 20);
  TiffPointer file(TIFFClientOpenExt("image", "rm", &input, read_input, write_nothing, seek_input,
                                     close_nothing, input_size, nullptr, nullptr, options));
  TIFFOpenOptionsFree(options);
  return file;
}

// libtiff's conversion of one file; ends with it.
struct TiffConversion {
  TIFFRGBAImage image{};
  bool good;
  TiffConversion(TIFF* file, char* words) : good(TIFFRGBAImageBegin(&image, file, 1, words)) {
    image.req_orientation = image.orientation;  // as stored
  }
  ~TiffConversion() {
    if (good) TIFFRGBAImageEnd(&image);
  }
  TiffConversion(const TiffConversion&) = delete;
  TiffConversion& operator=(const TiffConversion&) = delete;
};

// Whether colours that libtiff converts are multiplied by alpha. It leaves those of a channel that
// is not called alpha, which programs write that mean straight alpha.
bool is_premultiplied(TIFF* file) {
  uint16_t count = 0;
  const uint16_t* kinds = nullptr;
  TIFFGetFieldDefaulted(file, TIFFTAG_EXTRASAMPLES, &count, &kinds);
  return count > 0 && kinds[0] != EXTRASAMPLE_UNSPECIFIED;
}

uint8_t divided(uint32_t value, uint32_t alpha) {
  return alpha == 0 ? 0 : uint8_t(std::min((value * 255 + alpha / 2) / alpha, 255u));
}

void unpack(const std::vector<uint32_t>& packed, int channels, bool premultiplied, uint8_t* to) {
  for (const uint32_t pixel : packed) {
    const uint32_t alpha = channels == 4 && premultiplied ? TIFFGetA(pixel) : 255;
    to[0] = divided(TIFFGetR(pixel), alpha);
    to[1] = divided(TIFFGetG(pixel), alpha);
    to[2] = divided(TIFFGetB(pixel), alpha);
    if (channels == 4) to[3] = uint8_t(TIFFGetA(pixel));
    to += channels;
  }
}

}  // namespace

std::string tiff_header(ByteSource& source, ImageHeader& header) {
  TiffInput input{source};
  const TiffPointer file = open_tiff(input);
  if (!file) return fmt::format("its TIFF header is truncated or damaged ({})", input.words);
  char why[1024] = "";
  const TiffConversion conversion(file.get(), why);
  if (!conversion.good) return fmt::format("its kind of TIFF cannot be read ({})", why);
  header.width = int(std::min(conversion.image.width, uint32_t{INT_MAX}));
  header.height = int(std::min(conversion.image.height, uint32_t{INT_MAX}));
  header.has_alpha = conversion.image.alpha != 0;
  return "";
}

DecodedImage decode_tiff(const Bytes& bytes) {
  MemorySource source(bytes);
  TiffInput input{source};
  DecodedImage result;
  const TiffPointer file = open_tiff(input);
  char why[1024] = "";
  if (file) {
    TiffConversion conversion(file.get(), why);
    TIFFRGBAImage& image = conversion.image;
    std::vector<uint32_t> packed;
    if (conversion.good) packed.resize(size_t(image.width) * image.height);
    if (conversion.good && TIFFRGBAImageGet(&image, packed.data(), image.width, image.height)) {
      result.width = int(image.width);
      result.height = int(image.height);
      result.channels = image.alpha ? 4 : 3;
      result.bits = 8;
      result.pixels.resize(packed.size() * size_t(result.channels));
      unpack(packed, result.channels, is_premultiplied(file.get()), result.pixels.data());
    }
  }
  result.complaint = why[0] ? why : input.words;
  return result;
}

}  // namespace gflow
