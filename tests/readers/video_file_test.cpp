// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>
#include <unistd.h>

#include <opencv2/videoio.hpp>

#include "optim/images/video.hpp"
#include "optim/scene/frame_store.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

constexpr int width = 32, height = 24;

// `count` uniform images, frame k grey 40 + 30 k, in a container selected by the extension.
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

TEST(VideoFile, ATruncatedOneIsTold) {
  const TemporaryFolder folder;
  const std::string path = make_video(folder, "a.mkv", 40);
  EXPECT_EQ(read_scene(path).notices.size(), 1u);  // that there are no poses
  const std::string whole = contents(path);
  const Scene half = read_scene(folder.write("half.mkv", whole.substr(0, whole.size() / 2)));
  EXPECT_LT(half.steps, 30);
  ASSERT_EQ(half.notices.size(), 2u);
  EXPECT_NE(half.notices[0].find("of 4.00 s; the file seems cut off"), std::string::npos)
      << half.notices[0];
}

// Decoders continue after damage and report it. MPEG-4 frames of a moving pattern with bytes in the
// middle of the file overwritten.
TEST(VideoFile, ADamagedOneIsTold) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.avi");
  {
    cv::VideoWriter writer(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('X', 'V', 'I', 'D'), 10,
                           cv::Size(64, 48));
    for (int k = 0; k < 20; ++k) {
      cv::Mat image(48, 64, CV_8UC3);
      for (int i = 0; i < 48 * 64 * 3; ++i) image.data[i] = uint8_t((i + 7 * k) * (i + k) >> 4);
      writer.write(image);
    }
  }
  std::string bytes = contents(path);
  const auto said_of = [&](const std::string& file) {
    testing::internal::CaptureStderr();
    const size_t times = frame_times(file).size();
    Video video(file);
    for (size_t k = 0; k < times; ++k) video.frame(int(k));
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(said_of(path), "");
  for (size_t i = bytes.size() / 3; i < bytes.size() / 2; i += 50) bytes[i] ^= 0x55;
  const std::string damaged = folder.write("b.avi", bytes), said = said_of(damaged);
  EXPECT_EQ(said.rfind("gflow: warning: video " + damaged + " is damaged near ", 0), 0u) << said;
  EXPECT_NE(said.find(" s: its decoder reports '"), std::string::npos) << said;
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;  // once, not per frame
  EXPECT_EQ(said_of(path), "");
}

// Too many open files, or an unreadable file, must not be reported as damage.
TEST(VideoFile, TooManyOpenFilesAreNoDamage) {
  const TemporaryFolder folder;
  const std::string path = make_video(folder, "a.mkv", 3);
  EXPECT_EQ(video_info(path).frames, 3);
  rlimit before;
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const int next = ::dup(0);  // no further descriptor can be opened
  ::close(next);
  const rlimit none{rlim_t(next), before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  std::string said;
  try {
    video_info(path);
  } catch (const Error& problem) {
    said = problem.what();
  }
  ::setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_EQ(said, "cannot read video " + path + ": Too many open files");
}

// Peak address space so far [kB].
long most_addresses() {
  std::ifstream status("/proc/self/status");
  long most = 0;
  for (std::string word; status >> word && word != "VmPeak:";) continue;
  status >> most;
  return most;
}

// The header states tables of 1.7 GB, which FFmpeg would allocate before reading them.
TEST(VideoFile, TakesNoMemoryForWhatAHeaderStates) {
  const std::string file =
      std::string(GFLOW_SOURCE_DIR) + "/tests/data/fuzz/video/tables_of_1.7_GB.mp4";
  EXPECT_EXIT(  // in a new process, with a fresh peak
      {
        const long before = most_addresses();
        expect_error([&] { video_info(file); }, {"cannot read video"});
        const bool modest = before > 0 && most_addresses() - before < 1000000;
        std::_Exit(modest && !testing::Test::HasFailure() ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

// Otherwise a downloaded file could make gflow open any other file.
TEST(VideoFile, APlaylistIsNoVideo) {
  const TemporaryFolder folder;
  const std::string video = make_video(folder, "a.avi", 3);
  const std::string list = folder.write(
      "list.mp4", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + video + "\n#EXT-X-ENDLIST\n");
  EXPECT_EQ(video_info(video).frames, 3);
  EXPECT_THROW(video_info(list), Error);
}

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
  EXPECT_EQ(video_info(path).frames, 4);
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

TEST(VideoFile, AGivenCameraFilmsIt) {
  const TemporaryFolder folder;
  SceneOptions options;
  options.radius = 7;
  options.cameras =
      folder.write("cameras.json",
                   R"([{"img_name":"left.png","width":64,"height":48,"position":[1,2,3],
           "rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":80,"fy":90,"cx":30,"cy":20},
          {"img_name":"right","width":64,"height":48,"position":[4,2,3],
           "rotation":[[0,-1,0],[1,0,0],[0,0,1]],"fx":80,"fy":90}])");
  const std::string path = make_video(folder, "a.avi", 3);
  options.camera = "left";
  const Scene left = read_scene(path, options);
  ASSERT_EQ(left.cameras.size(), 1u);
  EXPECT_EQ(left.extent, 7);  // the distance of what it films
  EXPECT_TRUE(left.cameras[0].position().isApprox(Eigen::Vector3d(1, 2, 3)));
  // Half the size: seen at (80 / 2 + 30 / 2, 90 / 2 + 20 / 2) by hand.
  EXPECT_TRUE(left.cameras[0].project({2, 3, 4}).isApprox(Eigen::Vector2d(55, 55)));
  options.camera = "right";
  const Scene right = read_scene(path, options);  // camera to world: its x is the world's y
  EXPECT_TRUE(right.cameras[0].project({4, 3, 4}).isApprox(Eigen::Vector2d(56, 12)));
  options.camera = "middle";
  expect_error([&] { read_scene(path, options); }, {"'middle'", "left.png, right"});
  options.camera = "";
  expect_error([&] { read_scene(path, options); }, {"2 cameras", "3 images", "scene.camera"});
}

TEST(VideoFile, GivenPosesMoveTheCamera) {
  const TemporaryFolder folder;
  SceneOptions options;
  std::string frames;
  for (int k : {2, 0, 1})  // OpenGL axes; in the order of the names, not of the file
    frames += fmt::format(R"({}{{"file_path":"images/{}.jpg","transform_matrix":
                             [[1,0,0,{}],[0,1,0,0],[0,0,1,5],[0,0,0,1]]}})",
                          frames.empty() ? "" : ",", k, k);
  options.cameras = folder.write(
      "transforms.json", R"({"w":32,"h":24,"fl_x":40,"k1":0.01,"frames":[)" + frames + "]}");
  const Scene scene = read_scene(make_video(folder, "a.avi", 3), options);
  ASSERT_EQ(scene.cameras.size(), 3u);
  for (size_t k = 0; k < 3; ++k) {
    const Camera& camera = scene.cameras[size_t(scene.train[k].camera)];
    EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(double(k), 0, 5)));
    EXPECT_EQ(scene.train[k].track, 0);
    EXPECT_EQ(camera.lens.kind, Lens::Kind::radial);
  }
  EXPECT_EQ(neighbour_pairs(scene).size(), 2u);
  options.max_steps = 2;
  EXPECT_EQ(read_scene(folder.file("a.avi"), options).train.size(), 2u);
  options.max_steps = 0;
  expect_error([&] { read_scene(make_video(folder, "b.avi", 2), options); },
               {"3 cameras", "b.avi has 2 images"});
  options.cameras = folder.write("none.json", R"({"frames":[]})");
  expect_error([&] { read_scene(folder.file("a.avi"), options); }, {"none.json", "no frames"});
  options.cameras = folder.file("missing.json");
  expect_error([&] { read_scene(folder.file("a.avi"), options); }, {"missing.json"});
}

// Names of cameras end in the number of the frame, counted from 0 or 1.
TEST(VideoFile, FramesWithoutACameraOfTheirNumberAreLeftOutAndTold) {
  const TemporaryFolder folder;
  SceneOptions options;
  const std::string path = make_video(folder, "a.avi", 10);
  const auto read = [&](const std::vector<int>& numbers) {
    std::string frames;
    for (const int k : numbers)
      frames += fmt::format(R"({}{{"file_path":"images/frame_{:05}.jpg","transform_matrix":
                               [[1,0,0,{}],[0,1,0,0],[0,0,1,5],[0,0,0,1]]}})",
                            frames.empty() ? "" : ",", k, k);
    options.cameras = folder.write("transforms.json", R"({"fl_x":40,"frames":[)" + frames + "]}");
    return read_scene(path, options);
  };
  const auto expect = [&](const std::vector<int>& numbers, int first) {
    const Scene scene = read(numbers);
    EXPECT_EQ(scene.steps, int(numbers.size()));
    ASSERT_EQ(scene.train.size(), numbers.size());
    for (size_t i = 0; i < numbers.size(); ++i) {
      const Frame& frame = scene.train[i];
      EXPECT_EQ(frame.video_frame, numbers[i] - first);
      EXPECT_EQ(frame.step, int(i));
      EXPECT_EQ(scene.cameras[size_t(frame.camera)].position().x(), numbers[i]);
    }
    EXPECT_EQ(scene.train.front().time, 0);
    EXPECT_EQ(scene.train.back().time, 1);
    ASSERT_EQ(scene.notices.size(), 1u);
    EXPECT_EQ(scene.notices[0], fmt::format("{} of 10 frames of {} are left out: {} has no camera "
                                            "of their name",
                                            10 - numbers.size(), path, options.cameras));
  };
  expect({1, 2, 5, 10}, 1);
  expect({2, 3, 10}, 1);
  expect({0, 3, 4, 8}, 0);
  // Counted from 0 or 1; from neither; perhaps every second frame.
  for (const std::vector<int>& unclear :
       {std::vector<int>{1, 2, 9}, {0, 5, 10}, {3, 11}, {0, 1, 2, 3, 4}})
    expect_error([&] { read(unclear); }, {"a.avi has 10 images", "names that tell"});
  options.max_steps = 3;
  EXPECT_EQ(read({0, 1, 2, 3, 4}).train.size(), 3u);
  expect_error([&] { read({0, 2, 3, 4}); }, {"4 cameras", "a.avi has 3 images"});
}

TEST(VideoFile, AStatedFrameRateWins) {
  const TemporaryFolder folder;
  SceneOptions options;
  options.fps = 50;
  options.stride = 2;
  EXPECT_EQ(read_scene(make_video(folder, "a.avi", 4), options).fps, 25);
}

TEST(VideoFile, WhatIsNoVideoOrTooShortIsRefused) {
  const TemporaryFolder folder;
  expect_error([&] { read_scene(folder.write("a.mp4", "no video")); }, {"a.mp4", "cannot"});
  expect_error([&] { read_scene(folder.path() + "/b.mp4"); }, {"b.mp4", "no such"});
  const std::string path = make_video(folder, "c.mkv", 5);
  SceneOptions options;
  options.first_step = 5;
  expect_error([&] { read_scene(path, options); }, {"scene.first_step is 5", "c.mkv"});
}
