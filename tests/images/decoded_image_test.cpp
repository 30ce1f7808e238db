// SPDX-License-Identifier: Apache-2.0
// Every kind of image is read as by OpenCV, and messages of libpng and libjpeg do not reach stderr.
#include "optim/images/decoded_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "optim/images/image.hpp"
#include "optim/images/image_header.hpp"
#include "tests/support/png_writer.hpp"
#include "tests/support/scene_files.hpp"

namespace gflow {
namespace {

Bytes as_bytes(const std::string& text) { return {text.begin(), text.end()}; }

// The image as read by OpenCV, red first.
cv::Mat read_by_opencv(const Bytes& file) {
  const cv::Mat blue_first = cv::imdecode(file, cv::IMREAD_UNCHANGED);
  cv::Mat mat;
  if (blue_first.channels() == 1) return blue_first;
  cv::cvtColor(blue_first, mat,
               blue_first.channels() == 3 ? cv::COLOR_BGR2RGB : cv::COLOR_BGRA2RGBA);
  return mat;
}

void expect_pixels(const DecodedImage& found, const cv::Mat& expected) {
  ASSERT_EQ(found.width, expected.cols);
  ASSERT_EQ(found.height, expected.rows);
  ASSERT_EQ(found.channels, expected.channels());
  ASSERT_EQ(found.bits, expected.depth() == CV_16U ? 16 : 8);
  ASSERT_TRUE(expected.isContinuous());
  const size_t size = expected.total() * expected.elemSize();
  EXPECT_EQ(found.pixels, std::vector<uint8_t>(expected.data, expected.data + size));
}

TEST(Png, EveryKindIsReadAsOpenCvReadsIt) {
  const std::vector<std::pair<int, std::vector<int>>> depths{
      {0, {1, 2, 4, 8, 16}}, {2, {8, 16}}, {3, {1, 2, 4, 8}}, {4, {8, 16}}, {6, {8, 16}}};
  std::mt19937 rng(7);
  for (const auto& [colour, of_colour] : depths)
    for (const int depth : of_colour)
      for (const bool interlaced : {false, true})
        for (const bool transparent : {false, true}) {
          if (transparent && colour >= 4) continue;  // these types have alpha
          const PngKind kind{colour, depth, interlaced, transparent};
          SCOPED_TRACE(fmt::format("colour {}, {} bits{}{}", colour, depth,
                                   interlaced ? ", interlaced" : "",
                                   transparent ? ", transparent" : ""));
          const Bytes png = as_bytes(png_of(kind, random_rows(kind, rng)));
          const DecodedImage found = decode_png(png);
          EXPECT_EQ(found.complaint, "");
          expect_pixels(found, read_by_opencv(png));
          EXPECT_EQ(check_image_bytes(png, "it").has_alpha, found.channels == 4);
        }
}

TEST(Png, WhatNoPixelNeedsIsNotSpokenOf) {
  std::mt19937 rng(8);
  const PngKind kind{2, 8, false, false};
  const std::string rows = random_rows(kind, rng);
  const std::string profile = "a profile" + std::string(2, '\0') + deflated("is longer than this");
  const DecodedImage found = decode_png(
      as_bytes(png_of(kind, rows, png_chunk("iCCP", profile) + png_chunk("gAMA", "??"))));
  EXPECT_EQ(found.complaint, "");
  EXPECT_EQ(found.pixels, decode_png(as_bytes(png_of(kind, rows))).pixels);
}

// libpng would print "libpng warning: IDAT: Too much image data" each time.
TEST(Png, OneWithTooManyPixelsIsUsedAndNamedOnce) {
  const TemporaryFolder folder;
  std::mt19937 rng(9);
  const PngKind kind{2, 8, false, false};
  const std::string rows = random_rows(kind, rng);
  const std::string path = folder.write("long.png", png_of(kind, rows + std::string(20000, 'x')));
  const Image expected = read_image(folder.write("right.png", png_of(kind, rows)));
  testing::internal::CaptureStderr();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(read_image(path).pixels, expected.pixels);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said, fmt::format("gflow: warning: image {} may be damaged (IDAT: Too much image "
                              "data); using it anyway\n",
                              path));
}

TEST(Png, OnesWithTooFewPixelsAreRefusedWithTheReason) {
  const TemporaryFolder folder;
  std::mt19937 rng(10);
  const PngKind kind{6, 8, true, false};
  const std::string rows = random_rows(kind, rng);
  const std::string path = folder.write("short.png", png_of(kind, rows.substr(0, rows.size() / 2)));
  testing::internal::CaptureStderr();
  expect_error([&] { read_image(path); }, {"short.png", "damaged", "Not enough image data"});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// Random blocks, so that smoothing and chroma subsampling have an effect.
Bytes jpeg_of(int type, bool progressive) {
  cv::Mat blocks(9, 14, type), noise;
  cv::theRNG().state = 11;
  cv::randu(blocks, 0, 255);
  cv::resize(blocks, noise, cv::Size(67, 45), 0, 0, cv::INTER_LINEAR);
  Bytes coded;
  cv::imencode(".jpg", noise, coded, {cv::IMWRITE_JPEG_PROGRESSIVE, progressive});
  return coded;
}

TEST(Jpeg, EveryKindIsReadAsOpenCvReadsIt) {
  for (const int type : {CV_8UC1, CV_8UC3})
    for (const bool progressive : {false, true}) {
      const Bytes jpeg = jpeg_of(type, progressive);
      const DecodedImage found = decode_jpeg(jpeg);
      EXPECT_EQ(found.complaint, "");
      expect_pixels(found, read_by_opencv(jpeg));
    }
}

// 81 megapixels take 232 MiB, or 463 with the coefficients of subsampled colours.
TEST(Jpeg, ProgressiveOnesTakeMoreMemoryAndMustBeLonger) {
  for (const bool progressive : {false, true}) {
    Bytes jpeg = jpeg_of(CV_8UC3, progressive);
    const uint8_t frame[] = {0xff, uint8_t(progressive ? 0xc2 : 0xc0), 0, 17, 8};
    const auto at = std::search(jpeg.begin(), jpeg.end(), std::begin(frame), std::end(frame));
    ASSERT_NE(at, jpeg.end());
    for (const int i : {5, 7}) std::copy_n("\x23\x28", 2, at + i);  // 9000 x 9000
    if (progressive)
      expect_error([&] { check_image_bytes(jpeg, "a.jpg"); }, {"a.jpg", "would decompress to 463"});
    else
      EXPECT_EQ(check_image_bytes(jpeg, "a.jpg").width, 9000);
  }
}

// Only progressive JPEGs detect them, because gflow looks for the end marker there.
TEST(Jpeg, BytesThatMeanNothingAreNoDamage) {
  for (const bool progressive : {false, true}) {
    const Bytes jpeg = jpeg_of(CV_8UC3, progressive);
    Bytes longer = jpeg;
    longer.insert(longer.end() - 2, 5, 0);  // before the end marker
    testing::internal::CaptureStderr();
    const DecodedImage found = decode_jpeg(longer);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(found.complaint, "");
    EXPECT_EQ(found.pixels, decode_jpeg(jpeg).pixels);
  }
}

TEST(Jpeg, OnesThatLackPixelsAreDamaged) {
  for (const bool progressive : {false, true}) {
    const Bytes jpeg = jpeg_of(CV_8UC3, progressive);
    Bytes half(jpeg.begin(), jpeg.begin() + long(jpeg.size() / 2));
    half.insert(half.end(), {0xff, 0xd9});
    const DecodedImage found = decode_jpeg(half);
    EXPECT_NE(found.complaint, "");
    EXPECT_TRUE(found.pixels.empty());
  }
}

}  // namespace
}  // namespace gflow
