// SPDX-License-Identifier: Apache-2.0
#include "optim/images/image.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "optim/images/image_header.hpp"
#include "optim/images/video.hpp"
#include "tests/fuzz/checksums.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

std::string from_hex(const std::string& hex) {
  std::string bytes;
  for (size_t i = 0; i < hex.size(); i += 2)
    bytes += char(std::stoi(hex.substr(i, 2), nullptr, 16));
  return bytes;
}

// Made with another PNG writer (Python's zlib): 2x1 pixels each.
const char* const palette_png =
    "89504e470d0a1a0a0000000d4948445200000002000000010803000000c3fc8fb800000006504c54"
    "45ff00000000ff6ca1fd8e0000000274524e53ff80080fb36a0000000b4944415478da6360600400"
    "000400022cde48ad0000000049454e44ae426082";  // red opaque, blue half transparent
const char* const grey16_png =
    "89504e470d0a1a0a0000000d494844520000000200000001100000000081d9fc150000000d494441"
    "5478da636860f8ff1f000502027fc900d6750000000049454e44ae426082";  // 0x8000, 0xffff
const char* const grey_alpha_png =
    "89504e470d0a1a0a0000000d49484452000000020000000108040000005e2bb7010000000d494441"
    "5478da6348313af11f0004ba025eb45063140000000049454e44ae426082";  // 100 with alpha 50, 200 with
                                                                     // 255
const char* const kitti_png =
    "89504e470d0a1a0a0000000d49484452000000020000000110020000002bd0349e00000011494441"
    "5478da636870a86f606064000300124a01c15536afc50000000049454e44ae426082";  // (u, v) = (1, -2)
                                                                             // valid; second not
// By ImageMagick: 16x8 pixels of cyan, magenta, yellow and black, red on the left, blue on the
// right.
const char* const cmyk_jpeg =
    "ffd8ffee000e41646f626500640000000002ffdb0043000302020302020303030304030304050805"
    "050404050a070706080c0a0c0c0b0a0b0b0d0e12100d0e110e0b0b1016101113141515150c0f1718"
    "16141812141514ffdb00430103040405040509050509140d0b0d1414141414141414141414141414"
    "141414141414141414141414141414141414141414141414141414141414141414141414ffc00014"
    "080008001004011100021101031101041100ffc40017000003010000000000000000000000000000"
    "070809ffc40014100100000000000000000000000000000000ffc400150101010000000000000000"
    "0000000000000907ffc40014110100000000000000000000000000000000ffda000e040100021103"
    "110400003f00a2173154d533f41b98d0ffd9";

}  // namespace

TEST(Image, PngsAreReadAgainAsWritten) {
  const TemporaryFolder folder;
  for (int channels : {3, 4}) {
    const Image image = pattern(5, 3, channels);
    write_png(folder.file("a.png"), image);
    const Image back = read_image(folder.file("a.png"));
    EXPECT_EQ(back.width, 5);
    EXPECT_EQ(back.height, 3);
    EXPECT_EQ(back.channels, channels);
    EXPECT_EQ(back.pixels, image.pixels);
  }
  write_png(folder.file("g.png"), pattern(5, 3, 1));
  EXPECT_EQ(read_grey(folder.file("g.png")).pixels, pattern(5, 3, 1).pixels);
  EXPECT_EQ(read_image(folder.file("g.png")).channels, 3);
}

TEST(Image, PalettesAndGreyAndSixteenBitsBecomeRgb) {
  const TemporaryFolder folder;
  const Image palette = read_image(folder.write("p.png", from_hex(palette_png)));
  EXPECT_EQ(palette.channels, 4);
  EXPECT_EQ(palette.pixels, (std::vector<uint8_t>{255, 0, 0, 255, 0, 0, 255, 128}));
  const Image grey = read_image(folder.write("g.png", from_hex(grey16_png)));
  EXPECT_EQ(grey.pixels, (std::vector<uint8_t>{128, 128, 128, 255, 255, 255}));
  const Image both = read_image(folder.write("ga.png", from_hex(grey_alpha_png)));
  EXPECT_EQ(both.pixels, (std::vector<uint8_t>{100, 100, 100, 50, 200, 200, 200, 255}));
}

TEST(Image, HeadersTellSizeAndAlpha) {
  const TemporaryFolder folder;
  const ImageHeader palette = read_image_header(folder.write("p.png", from_hex(palette_png)));
  EXPECT_EQ(palette.width, 2);
  EXPECT_EQ(palette.height, 1);
  EXPECT_TRUE(palette.has_alpha);
  make_png(folder, "rgb.png", 9, 4);
  const ImageHeader rgb = read_image_header(folder.file("rgb.png"));
  EXPECT_EQ(rgb.width, 9);
  EXPECT_EQ(rgb.height, 4);
  EXPECT_FALSE(rgb.has_alpha);
}

TEST(Image, TheBackgroundShowsThroughStraightAlpha) {
  const Image rgba{3, 1, 4, {200, 100, 0, 255, 200, 100, 0, 0, 200, 100, 0, 51}};
  const Image rgb = over_background(rgba, {255, 255, 255});
  // alpha 51/255 = 1/5: 200/5 + 255*4/5 = 244, 20 + 204 = 224, 204
  EXPECT_EQ(rgb.pixels, (std::vector<uint8_t>{200, 100, 0, 255, 255, 255, 244, 224, 204}));
  EXPECT_EQ(over_background(pattern(2, 2), {0, 0, 0}).pixels, pattern(2, 2).pixels);
}

TEST(Image, ShrinkingTakesTheMean) {
  const Image image{4, 2, 1, {0, 4, 10, 10, 8, 12, 20, 20}};
  EXPECT_EQ(resized(image, 2, 1).pixels, (std::vector<uint8_t>{6, 15}));
}

TEST(Image, ShrinkingDoesNotMixInHiddenColors) {
  // The hidden green has alpha 0.
  const Image image{2, 1, 4, {200, 0, 0, 255, 0, 255, 0, 0}};
  EXPECT_EQ(resized(image, 1, 1).pixels, (std::vector<uint8_t>{200, 0, 0, 128}));
}

TEST(Image, SixteenBitPngsKeepTheirValues) {
  const TemporaryFolder folder;
  write_png16(folder.file("d.png"), 2, 1, {0x8000, 0xffff});
  EXPECT_EQ(read_grey(folder.file("d.png")).pixels, (std::vector<uint8_t>{128, 255}));
  expect_error([&] { write_png16(folder.file("e.png"), 2, 2, {1}); }, {"e.png", "2x2"});
}

TEST(Image, KittiFlowIsDecoded) {
  const TemporaryFolder folder;
  const FlowField flow = read_kitti_flow(folder.write("f.png", from_hex(kitti_png)));
  EXPECT_EQ(flow.uv, (std::vector<float>{1, -2, 0, 0}));
  EXPECT_EQ(flow.valid, (std::vector<uint8_t>{1, 0}));
  make_png(folder, "8bit.png");
  expect_error([&] { read_kitti_flow(folder.file("8bit.png")); }, {"8bit.png", "16-bit"});
}

TEST(Image, KittiFlowIsNotUnpackedBeyondWhatFlowPacks) {
  const TemporaryFolder folder;
  const std::string found =
      contents(GFLOW_SOURCE_DIR "/tests/data/fuzz/kitti_flow/flow_of_62_megapixels");
  const auto* bytes = reinterpret_cast<const uint8_t*>(found.data());
  const std::string path = folder.write("f.png", fuzz::with_png_checksums(bytes, found.size()));
  expect_error([&] { read_kitti_flow(path); }, {"f.png", "would decompress to"});
}

TEST(Image, TruncatedPngsAreRefusedAtEveryLength) {
  const TemporaryFolder folder;
  make_png(folder, "a.png");
  const std::string whole = contents(folder.file("a.png"));
  for (size_t n = 0; n < whole.size(); ++n) {
    const std::string path = folder.write("cut.png", whole.substr(0, n));
    EXPECT_THROW(read_image(path), Error) << n << " of " << whole.size() << " bytes";
  }
}

TEST(Image, WhatIsNoImageIsRefused) {
  const TemporaryFolder folder;
  expect_error([&] { read_image(folder.path() + "/none.png"); }, {"none.png", "No such file"});
  expect_error([&] { read_image(folder.write("a.png", "text")); }, {"a.png", "neither"});
  std::string huge = from_hex(grey16_png);
  huge[16] = 0x7f;  // first byte of the width
  expect_error([&] { read_image(folder.write("h.png", huge)); },
               {"h.png", "expected sides of 1 to"});
  make_png(folder, "b.png");
  std::string bomb = contents(folder.file("b.png"));
  bomb[18] = bomb[22] = 0x30;  // slightly more than 12288 pixels per side
  expect_error([&] { read_image(folder.write("b.png", bomb)); },
               {"b.png", "a PNG checksum is wrong"});
  const auto* bytes = reinterpret_cast<const uint8_t*>(bomb.data());
  bomb = fuzz::with_png_checksums(bytes, bomb.size());
  expect_error([&] { read_image(folder.write("b.png", bomb)); }, {"b.png", "would decompress to"});
}

TEST(Image, GreyCountsAsTheThreeChannelsThatItBecomes) {
  const TemporaryFolder folder;
  write_png(folder.file("g.png"), pattern(16, 16, 1));
  std::string bomb = contents(folder.file("g.png"));
  bomb[18] = bomb[22] = 0x30;  // 12304 x 12304: 151 MB of grey, 454 MB of RGB
  const auto* bytes = reinterpret_cast<const uint8_t*>(bomb.data());
  bomb = fuzz::with_png_checksums(bytes, bomb.size());
  const std::string path = folder.write("b.png", bomb);
  expect_error([&] { read_image(path); }, {"b.png", "would decompress to"});
  expect_error([&] { read_grey(path); }, {"b.png", "would decompress to"});
}

TEST(Image, GreyIsReadWithoutASecondCopyInColour) {
  const TemporaryFolder folder;
  const std::string path = folder.file("g.png");
  write_png(path, Image{4096, 4096, 1, std::vector<uint8_t>(size_t{4096} * 4096, 7)});
  // 16 MiB as stored and 48 MiB of RGB; a copy would add 48 MiB.
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_image(path).pixels.back(), 7); }), 80);
}

TEST(Image, JpegsOfFourInksBecomeRgb) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.jpg", from_hex(cmyk_jpeg));
  const ImageHeader header = read_image_header(path);
  EXPECT_EQ(header.width, 16);
  EXPECT_EQ(header.height, 8);
  EXPECT_FALSE(header.has_alpha);
  const Image image = read_image(path);
  ASSERT_EQ(image.channels, 3);
  for (const int x : {2, 13})
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(image.pixels[size_t(3 * (16 * 4 + x) + c)], c == (x < 8 ? 0 : 2) ? 255 : 0, 3);
}

// As in COLMAP and nerfstudio, whose intrinsics and poses refer to the stored pixels: the
// orientation tag is ignored.
TEST(Image, JpegsAreReadAsStoredHoweverTheCameraWasHeld) {
  const TemporaryFolder folder;
  std::vector<uint8_t> coded;
  ASSERT_TRUE(cv::imencode(".jpg", cv::Mat(24, 32, CV_8UC3, cv::Scalar(10, 120, 230)), coded));
  const std::string plain(coded.begin(), coded.end());
  const Image image = read_image(folder.write("plain.jpg", plain));
  for (int turn = 1; turn <= 8; ++turn) {
    // An APP1 segment of 34 bytes with one little-endian entry: tag 0x0112, orientation.
    std::string turned = plain;
    turned.insert(2, from_hex("ffe10022457869660000"
                              "49492a0008000000"
                              "0100"
                              "1201030001000000") +
                         char(turn) + std::string(7, '\0'));
    const std::string path = folder.write("turned.jpg", turned);
    const std::vector<char> bytes(turned.begin(), turned.end());
    EXPECT_EQ(cv::imdecode(bytes, cv::IMREAD_COLOR).cols, turn > 4 ? 24 : 32) << "others turn it";
    EXPECT_EQ(read_image_header(path).width, 32) << turn;
    const Image read = read_image(path);
    EXPECT_EQ(read.width, 32) << turn;
    EXPECT_EQ(read.pixels, image.pixels) << turn;
  }
}

TEST(Image, JpegsThatAreWrittenShowTheImage) {
  const Image image{32, 24, 3, std::vector<uint8_t>(32 * 24 * 3, 90)};
  const std::vector<uint8_t> bytes = jpeg_of(image, 85);
  const cv::Mat read = cv::imdecode(bytes, cv::IMREAD_COLOR);
  ASSERT_EQ(read.cols, 32);
  ASSERT_EQ(read.rows, 24);
  EXPECT_NEAR(read.at<cv::Vec3b>(12, 16)[1], 90, 1);
  EXPECT_EQ(jpeg_of(image, 85), bytes);
  EXPECT_THROW(jpeg_of({1, 1, 1, {0}}, 85), Error);
}

TEST(Image, TruncatedJpegsAreRefused) {
  const std::string path = shared("data/dynerf_flame_steak_5v/images/1.jpg");
  if (!std::filesystem::exists(path)) return;  // this build cannot write JPEGs
  const TemporaryFolder folder;
  const ImageHeader header = read_image_header(path);
  EXPECT_EQ(header.width, 2704);
  EXPECT_EQ(header.height, 2028);
  const std::string whole = contents(path);
  const std::string cut = folder.write("cut.jpg", whole.substr(0, whole.size() / 2));
  expect_error([&] { read_image(cut); }, {"cut.jpg", "truncated"});
}

TEST(Image, JpegsThatLackPixelsAreRefused) {
  const TemporaryFolder folder;
  cv::Mat noise(48, 64, CV_8UC3);
  cv::randu(noise, 0, 255);
  for (const bool progressive : {false, true}) {
    std::vector<uint8_t> coded;
    ASSERT_TRUE(cv::imencode(".jpg", noise, coded, {cv::IMWRITE_JPEG_PROGRESSIVE, progressive}));
    const std::string whole(coded.begin(), coded.end()), end = "\xff\xd9";
    EXPECT_EQ(read_image(folder.write("a.jpg", whole)).width, 64);
    const std::string half = folder.write("half.jpg", whole.substr(0, whole.size() / 2) + end);
    expect_error([&] { read_image(half); }, {"half.jpg", "damaged", "premature end"});
    // Some cameras append padding.
    std::string longer = whole;
    longer.insert(whole.size() - 2, 5, '\0');
    testing::internal::CaptureStderr();
    EXPECT_EQ(read_image(folder.write("b.jpg", longer)).width, 64);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  }
}

TEST(Video, FramesAreReadAgainInAnyOrder) {
  const TemporaryFolder folder;
  std::vector<Image> frames;
  for (int k = 0; k < 6; ++k) {
    Image image{33, 17, 3, {}};  // odd: padded to 34x18
    image.pixels.assign(33 * 17 * 3, uint8_t(40 * k + 20));
    frames.push_back(image);
  }
  const std::string path = folder.file("a.mp4");
  make_mp4(path, frames, 10);
  EXPECT_EQ(folder.count(), 1u);
  const VideoInfo info = video_info(path);
  EXPECT_EQ(info.width, 34);
  EXPECT_EQ(info.height, 18);
  EXPECT_EQ(info.frames, 6);
  EXPECT_NEAR(info.fps, 10, 1e-6);
  Video video(path);
  for (int k : {0, 3, 1, 5, 5}) {
    // Flat grey survives the codec within a few levels; neighbours differ by 40.
    EXPECT_NEAR(video.frame(k).pixels[900], 40 * k + 20, 8) << "frame " << k;
  }
  expect_error([&] { video.frame(6); },
               {"a.mp4", "only 6 frames could be read", "frame 7 is needed", "seems cut off"});
}

TEST(Video, WhatIsNoVideoIsRefused) {
  const TemporaryFolder folder;
  expect_error([&] { video_info(folder.path() + "/none.mp4"); }, {"none.mp4", "no such file"});
  expect_error([&] { video_info(folder.write("a.mp4", "no video at all")); }, {"a.mp4"});
  expect_error([&] { make_mp4(folder.file("b.mp4"), {}, 10); }, {"b.mp4", "no frames"});
  expect_error(
      [&] {
        make_mp4(folder.file("b.mp4"), {pattern(4, 4), pattern(6, 4)}, 10);
      },
      {"equal size"});
  EXPECT_FALSE(std::filesystem::exists(folder.file("b.mp4")));
}
