// SPDX-License-Identifier: Apache-2.0
// Every kind of PNG is read as OpenCV reads it, and libpng is heard instead of writing on stderr.
#include "optim/data/png.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <opencv2/imgcodecs.hpp>
#include <random>

#include "data_readers/made_scene.hpp"
#include "optim/data/image.hpp"
#include "optim/data/image_header.hpp"

namespace gflow {
namespace {

std::string big_endian(size_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += char(value >> shift & 255);
  return bytes;
}

std::string chunk(const std::string& name, const std::string& data) {
  const std::string named = name + data;
  const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(named.data()), uInt(named.size()));
  return big_endian(data.size()) + named + big_endian(sum);
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()));
  packed.resize(size);
  return packed;
}

struct Kind {
  int colour, depth;  // as IHDR has them
  bool interlaced, transparent;
};

// Samples a pixel, of PNG's kinds of colour.
int samples(int colour) { return colour == 2 ? 3 : colour == 4 ? 2 : colour == 6 ? 4 : 1; }

constexpr size_t kWidth = 13, kHeight = 9;

// Unfiltered rows of random bytes, of 0 and 1 where a colour is transparent; of Adam7's seven
// pictures, where it is interlaced.
std::string random_rows(const Kind& kind, std::mt19937& rng) {
  struct Pass {
    size_t x, y, dx, dy;
  };
  const std::vector<Pass> adam7{{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
  std::string rows;
  for (const Pass& p : kind.interlaced ? adam7 : std::vector<Pass>{{0, 0, 1, 1}}) {
    const size_t width = (kWidth - p.x + p.dx - 1) / p.dx;
    const size_t bytes = (width * size_t(samples(kind.colour) * kind.depth) + 7) / 8;
    for (size_t y = p.y; y < kHeight; y += p.dy) {
      rows += '\0';
      for (size_t k = 0; k < bytes; ++k) rows += char(kind.transparent ? rng() & 1 : rng());
    }
  }
  return rows;
}

std::string png_of(const Kind& kind, const std::string& rows, const std::string& more = "") {
  std::string bytes = "\x89PNG\r\n\x1a\n";
  const std::string none(2, '\0');  // deflate, its filters
  bytes += chunk("IHDR", big_endian(kWidth) + big_endian(kHeight) + char(kind.depth) +
                             char(kind.colour) + none + char(kind.interlaced));
  bytes += more;
  if (kind.colour == 3) {
    std::string palette;
    for (int i = 0; i < 3 << kind.depth; ++i) palette += char(37 * i);
    bytes += chunk("PLTE", palette);
  }
  if (kind.transparent) {  // entries of the palette; a grey, or a colour, whose samples are 1
    const std::string one("\0\1", 2);
    bytes += chunk("tRNS", kind.colour == 3   ? "\x10\x80"
                           : kind.colour == 0 ? one
                                              : one + one + one);
  }
  return bytes + chunk("IDAT", deflated(rows)) + chunk("IEND", "");
}

Bytes as_bytes(const std::string& text) { return {text.begin(), text.end()}; }

TEST(Png, EveryKindIsReadAsOpenCvReadsIt) {
  const std::vector<std::pair<int, std::vector<int>>> depths{
      {0, {1, 2, 4, 8, 16}}, {2, {8, 16}}, {3, {1, 2, 4, 8}}, {4, {8, 16}}, {6, {8, 16}}};
  std::mt19937 rng(7);
  for (const auto& [colour, of_colour] : depths)
    for (const int depth : of_colour)
      for (const bool interlaced : {false, true})
        for (const bool transparent : {false, true}) {
          if (transparent && colour >= 4) continue;  // they have alpha
          const Kind kind{colour, depth, interlaced, transparent};
          SCOPED_TRACE(fmt::format("colour {}, {} bits{}{}", colour, depth,
                                   interlaced ? ", interlaced" : "",
                                   transparent ? ", transparent" : ""));
          const Bytes png = as_bytes(png_of(kind, random_rows(kind, rng)));
          const cv::Mat expected = cv::imdecode(png, cv::IMREAD_UNCHANGED);
          const DecodedPng found = decode_png(png);
          EXPECT_EQ(found.complaint, "");
          ASSERT_EQ(found.pixels.type(), expected.type());
          ASSERT_EQ(found.pixels.size(), expected.size());
          EXPECT_EQ(cv::norm(found.pixels, expected, cv::NORM_INF), 0);
          EXPECT_EQ(check_image_bytes(png, "it").has_alpha, found.pixels.channels() == 4);
        }
}

TEST(Png, WhatNoPixelNeedsIsNotSpokenOf) {
  std::mt19937 rng(8);
  const Kind kind{2, 8, false, false};
  const std::string rows = random_rows(kind, rng);
  const std::string profile = "a profile" + std::string(2, '\0') + deflated("is longer than this");
  const DecodedPng found =
      decode_png(as_bytes(png_of(kind, rows, chunk("iCCP", profile) + chunk("gAMA", "??"))));
  EXPECT_EQ(found.complaint, "");
  const cv::Mat plain = decode_png(as_bytes(png_of(kind, rows))).pixels;
  EXPECT_EQ(cv::norm(found.pixels, plain, cv::NORM_INF), 0);
}

// libpng would write "libpng warning: IDAT: Too much image data" each time.
TEST(Png, OneWithTooManyPixelsIsUsedAndNamedOnce) {
  const TemporaryFolder folder;
  std::mt19937 rng(9);
  const Kind kind{2, 8, false, false};
  const std::string rows = random_rows(kind, rng);
  const std::string path = folder.write("long.png", png_of(kind, rows + std::string(20000, 'x')));
  const Image expected = read_image(folder.write("right.png", png_of(kind, rows)));
  testing::internal::CaptureStderr();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(read_image(path).pixels, expected.pixels);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said, fmt::format("gflow: warning: picture {} may be damaged (IDAT: Too much image "
                              "data); it is used all the same\n",
                              path));
}

TEST(Png, OnesWithTooFewPixelsAreRefusedWithTheReason) {
  const TemporaryFolder folder;
  std::mt19937 rng(10);
  const Kind kind{6, 8, true, false};
  const std::string rows = random_rows(kind, rng);
  const std::string path = folder.write("short.png", png_of(kind, rows.substr(0, rows.size() / 2)));
  testing::internal::CaptureStderr();
  expect_error([&] { read_image(path); }, {"short.png", "damaged", "Not enough image data"});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace gflow
