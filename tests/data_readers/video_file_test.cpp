// SPDX-License-Identifier: Apache-2.0
#include <opencv2/videoio.hpp>

#include "data_readers/made_scene.hpp"
#include "optim/data/frame_store.hpp"
#include "optim/data/scene.hpp"
#include "optim/data/video.hpp"

using namespace gflow;

namespace {

constexpr int width = 32, height = 24;

// `count` flat pictures, frame k grey 40 + 30 k, in a container by the name's extension.
std::string make_video(const TemporaryFolder& folder, const std::string& name, int count,
                       const char* code = "MJPG", double fps = 10) {
  const std::string path = folder.file(name);
  cv::VideoWriter writer(path, cv::CAP_FFMPEG,
                         cv::VideoWriter::fourcc(code[0], code[1], code[2], code[3]), fps,
                         cv::Size(width, height));
  for (int k = 0; k < count; ++k)
    writer.write(cv::Mat(height, width, CV_8UC3, cv::Scalar::all(40 + 30 * k)));
  return path;
}

// Shifts one frame of a Matroska file in time: a block of track 1 (0x81) begins with its 16-bit
// time in milliseconds.
void move_frame(const std::string& path, int from_ms, int to_ms) {
  std::string bytes = contents(path);
  const std::string before{char(0x81), char(from_ms >> 8), char(from_ms & 255), char(0x80)};
  const size_t at = bytes.find(before);
  ASSERT_NE(at, std::string::npos);
  ASSERT_EQ(bytes.find(before, at + 1), std::string::npos);
  bytes[at + 1] = char(to_ms >> 8);
  bytes[at + 2] = char(to_ms & 255);
  std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace

TEST(VideoFile, AFileIsASceneOfOneStaticCamera) {
  const TemporaryFolder folder;
  for (const char* name : {"a.avi", "a.mkv", "a.mov"}) {
    SceneOptions options;
    options.radius = 3;
    const Scene scene = read_scene(make_video(folder, name, 5), options);
    EXPECT_EQ(scene.layout, "video");
    EXPECT_EQ(scene.name, "a");
    EXPECT_EQ(scene.steps, 5);
    EXPECT_NEAR(scene.fps, 10, 1e-6);
    ASSERT_EQ(scene.train.size(), 5u) << name;
    EXPECT_EQ(scene.test.size(), 5u);
    EXPECT_EQ(neighbour_pairs(scene).size(), 4u);
    for (int k = 0; k < 5; ++k) EXPECT_NEAR(scene.train[size_t(k)].time, k / 4., 1e-3) << name;
    EXPECT_EQ(scene.cameras[0].width, width);
    EXPECT_NEAR(scene.cameras[0].position().x(), 3, 1e-12);
    FrameStore store(scene);
    EXPECT_NEAR(store.rgb(scene.train[3])->pixels[0], 130, 4);
  }
}

TEST(VideoFile, TimesOfAVariableFrameRateAreTheContainers) {
  const TemporaryFolder folder;
  const std::string path = make_video(folder, "a.mkv", 5);
  move_frame(path, 200, 260);
  const std::vector<double> times = frame_times(path);
  ASSERT_EQ(times.size(), 5u);
  EXPECT_NEAR(times[1], 0.1, 1e-6);
  EXPECT_NEAR(times[2], 0.26, 1e-6);
  EXPECT_NEAR(read_scene(path).train[2].time, 0.26 / 0.4, 1e-6);
}

TEST(VideoFile, FramesAreCountedWhereTheHeaderLies) {
  const TemporaryFolder folder;
  const std::string path = make_video(folder, "a.avi", 4);
  std::string bytes = contents(path);
  const auto set = [&](size_t at) { bytes.replace(at, 4, std::string("\x64\0\0\0", 4)); };
  set(bytes.find("avih") + 8 + 16);  // dwTotalFrames
  set(bytes.find("strh") + 8 + 32);  // dwLength of the stream
  std::ofstream(path, std::ios::binary) << bytes;
  EXPECT_EQ(video_info(path).frames, 100);  // the lie is believed there
  EXPECT_EQ(frame_times(path).size(), 4u);
  EXPECT_EQ(read_scene(path).steps, 4);
}

TEST(VideoFile, OnlyTheFramesInUseAreDecodedAndTheirTimesFillTheRange) {
  const TemporaryFolder folder;
  SceneOptions options;
  options.first_step = 1;
  options.stride = 2;
  options.max_steps = 2;
  const Scene scene = read_scene(make_video(folder, "a.avi", 7), options);
  ASSERT_EQ(scene.train.size(), 2u);
  EXPECT_EQ(scene.train[0].video_frame, 1);
  EXPECT_EQ(scene.train[1].video_frame, 3);
  EXPECT_EQ(scene.train[1].step, 1);
  EXPECT_EQ(scene.train[0].time, 0);
  EXPECT_EQ(scene.train[1].time, 1);
  EXPECT_NEAR(scene.fps, 5, 1e-6);
  EXPECT_EQ(frame_times(folder.file("a.avi"), 4).size(), 4u);
}

TEST(VideoFile, WhatIsNoVideoOrTooShortIsRefused) {
  const TemporaryFolder folder;
  expect_error([&] { read_scene(folder.write("a.mp4", "no video")); }, {"a.mp4", "cannot"});
  expect_error([&] { read_scene(folder.path() + "/b.mp4"); }, {"b.mp4", "no such"});
  const std::string path = make_video(folder, "c.mkv", 5);
  SceneOptions options;
  options.first_step = 5;
  expect_error([&] { read_scene(path, options); }, {"first step", "5", "c.mkv"});
}
