// SPDX-License-Identifier: Apache-2.0
// Every kind of image is read as by OpenCV or as it was written, and no library's message reaches
// stderr.
#include "optim/images/decoded_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "optim/images/image.hpp"
#include "optim/images/image_header.hpp"
#include "tests/support/png_writer.hpp"
#include "tests/support/scene_files.hpp"

namespace gflow {
namespace fs = std::filesystem;
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

// Random pixels, written by OpenCV.
cv::Mat random_pixels(int type) {
  cv::Mat pixels(23, 31, type);
  cv::theRNG().state = 12;
  cv::randu(pixels, 0, CV_MAT_DEPTH(type) == CV_16U ? 65536 : 256);
  return pixels;
}

// Blue first to red first; grey to RGB; 8 bits.
cv::Mat shown(cv::Mat pixels) {
  if (pixels.depth() == CV_16U) pixels.convertTo(pixels, CV_8U, 1 / 257.);
  const int conversion = pixels.channels() == 1   ? cv::COLOR_GRAY2RGB
                         : pixels.channels() == 3 ? cv::COLOR_BGR2RGB
                                                  : cv::COLOR_BGRA2RGBA;
  cv::Mat rgb;
  cv::cvtColor(pixels, rgb, conversion);
  return rgb;
}

// Reads bytes as an image of that name.
Image read_as(const std::string& name, const Bytes& bytes) {
  const TemporaryFolder folder;
  return read_image(folder.write(name, std::string(bytes.begin(), bytes.end())));
}

void expect_pixels(const Image& found, const cv::Mat& expected) {
  expect_pixels(DecodedImage{found.width, found.height, found.channels, 8, found.pixels, ""},
                expected);
}

TEST(Webp, LosslessOnesAreReadAsTheyWereWritten) {
  for (const int type : {CV_8UC3, CV_8UC4}) {
    const cv::Mat pixels = random_pixels(type);
    Bytes webp;
    cv::imencode(".webp", pixels, webp, {cv::IMWRITE_WEBP_QUALITY, 101});
    EXPECT_EQ(check_image_bytes(webp, "a.webp").has_alpha, type == CV_8UC4);
    cv::Mat expected = shown(pixels);
    Image found = read_as("a.webp", webp);
    // The encoder drops colours that no one sees.
    for (size_t i = 0; found.channels == 4 && i < found.pixels.size(); i += 4)
      if (found.pixels[i + 3] == 0) {
        std::fill_n(&found.pixels[i], 3, uint8_t{0});
        std::fill_n(expected.data + i, 3, uint8_t{0});
      }
    expect_pixels(found, expected);
  }
}

TEST(Webp, LossyOnesAreReadAsByTheirLibrary) {
  Bytes webp;
  cv::imencode(".webp", random_pixels(CV_8UC3), webp, {cv::IMWRITE_WEBP_QUALITY, 80});
  expect_pixels(decode_webp(webp), read_by_opencv(webp));
}

TEST(Tiff, EveryKindIsReadAsItWasWritten) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4})
    for (const int compression : {1, 5, 8}) {  // none, LZW, deflate
      SCOPED_TRACE(fmt::format("type {}, compression {}", type, compression));
      const cv::Mat pixels = random_pixels(type);
      Bytes tiff;
      ASSERT_TRUE(cv::imencode(".tiff", pixels, tiff, {cv::IMWRITE_TIFF_COMPRESSION, compression}));
      EXPECT_EQ(check_image_bytes(tiff, "a.tif").has_alpha, CV_MAT_CN(type) == 4);
      if (type != CV_16UC1) {
        expect_pixels(read_as("a.tif", tiff), shown(pixels));
        continue;
      }
      // libtiff takes the upper byte of grey of 16 bits and does not round it.
      const Image found = read_as("a.tif", tiff);
      const cv::Mat expected = shown(pixels);
      ASSERT_EQ(found.pixels.size(), expected.total() * 3);
      for (size_t i = 0; i < found.pixels.size(); ++i)
        ASSERT_NEAR(found.pixels[i], expected.data[i], 1);
    }
}

// A TIFF of one pixel whose fourth sample is of that kind.
Bytes tiff_of(std::array<uint8_t, 4> pixel, uint8_t kind_of_extra) {
  const uint8_t tags[][2] = {{0, 1}, {1, 1}, {2, 0}, {3, 1}, {6, 2}, {17, 0}, {21, 4}, {23, 4}};
  constexpr uint8_t count = 9, data = 8 + 2 + 12 * count + 4;  // with tag 338
  Bytes bytes{'I', 'I', '*', 0, 8, 0, 0, 0, count, 0};
  const auto add = [&](int tag, int values, uint8_t value) {
    bytes.insert(bytes.end(),
                 {uint8_t(tag), uint8_t(tag >> 8), 3, 0, uint8_t(values), 0, 0, 0, value, 0, 0, 0});
  };
  for (const auto& [tag, value] : tags) {
    // 258 bits, 273 offset
    const uint8_t actual = tag == 2 ? uint8_t(data + 4) : tag == 17 ? data : value;
    add(256 + tag, tag == 2 ? 4 : 1, actual);
  }
  add(338, 1, kind_of_extra);
  bytes.insert(bytes.end(), 4, 0);  // no next image
  bytes.insert(bytes.end(), pixel.begin(), pixel.end());
  for (int i = 0; i < 4; ++i) bytes.insert(bytes.end(), {8, 0});
  return bytes;
}

TEST(Tiff, AlphaIsStraightWhateverIsStored) {
  const std::vector<uint8_t> straight{200, 100, 50, 51};
  EXPECT_EQ(decode_tiff(tiff_of({200, 100, 50, 51}, 0)).pixels, straight);  // unspecified
  EXPECT_EQ(decode_tiff(tiff_of({40, 20, 10, 51}, 1)).pixels, straight);    // associated
  EXPECT_EQ(decode_tiff(tiff_of({200, 100, 50, 51}, 2)).pixels, straight);  // not associated
}

TEST(WebpAndTiff, DamagedOnesAreRefusedWithTheirName) {
  for (const char* name : {"a.webp", "a.tiff"}) {
    Bytes bytes;
    cv::imencode(fs::path(name).extension().string(), random_pixels(CV_8UC3), bytes);
    testing::internal::CaptureStderr();
    for (const size_t size : {bytes.size() / 2, bytes.size() - 5, size_t{13}})
      expect_error([&] { read_as(name, Bytes(bytes.begin(), bytes.begin() + long(size))); },
                   {"cannot read image", name});
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  }
}

}  // namespace
}  // namespace gflow
