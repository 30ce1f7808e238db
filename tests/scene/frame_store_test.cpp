// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/frame_store.hpp"

#include <thread>

#include "tests/support/environment.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

Scene make_scene(const TemporaryFolder& folder, int channels = 4, int frames = 3) {
  for (int k = 0; k < frames; ++k) make_png(folder, fmt::format("{}.png", k), 8, 6, channels, k);
  return read_scene(folder.path());
}

// A scene whose only camera is a video of four uniform images.
Scene video_scene(const TemporaryFolder& folder) {
  std::vector<Image> frames;
  for (int k = 0; k < 4; ++k)
    frames.push_back({16, 12, 3, std::vector<uint8_t>(16 * 12 * 3, uint8_t(50 * k + 20))});
  make_mp4(folder.file("cam00.mp4"), frames, 10);
  Scene scene;
  Camera camera;
  camera.name = "cam00";
  camera.width = 16;
  camera.height = 12;
  scene.cameras = {camera};
  for (int k = 0; k < 4; ++k) {
    Frame frame;
    frame.path = folder.file("cam00.mp4");
    frame.video_frame = k;
    scene.train.push_back(frame);
  }
  return scene;
}

}  // namespace

TEST(FrameStore, GivesRgbOnTheBackgroundAndAlpha) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder);
  FrameStoreOptions options;
  options.background = {10, 20, 30};
  FrameStore store(scene, options);
  const Image rgba = pattern(8, 6, 4, 1);
  EXPECT_EQ(store.rgb(scene.train[1])->pixels, over_background(rgba, {10, 20, 30}).pixels);
  EXPECT_EQ(store.alpha(scene.train[1])->pixels[5], rgba.pixels[4 * 5 + 3]);
  EXPECT_EQ(store.rgb_over(scene.train[1], {0, 0, 0}).pixels,
            over_background(rgba, {0, 0, 0}).pixels);
}

TEST(FrameStore, ImagesWithoutAlphaHaveNone) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder, 3);
  FrameStore store(scene);
  EXPECT_EQ(store.alpha(scene.train[0]), nullptr);
  EXPECT_EQ(store.rgb(scene.train[0])->pixels, pattern(8, 6, 3, 0).pixels);
}

TEST(FrameStore, ReducesImagesAndCamerasAlike) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder, 3);
  FrameStoreOptions options;
  options.resolution = 2;
  FrameStore store(scene, options);
  EXPECT_EQ(store.rgb(scene.train[0])->width, 4);
  EXPECT_EQ(store.camera(scene.train[0]).height, 3);
  EXPECT_NEAR(store.cameras()[0].fx, scene.cameras[0].fx / 2, 1e-12);
}

TEST(FrameStore, ASmallCacheStillGivesEveryImageToEveryThread) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder, 3, 6);
  FrameStoreOptions options;
  options.cache_bytes = 200;  // one image has 144 bytes
  FrameStore store(scene, options);
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t)
    threads.emplace_back([&, t] {
      for (int n = 0; n < 30; ++n) {
        const int k = (n * 5 + t) % 6;
        store.prefetch({&scene.train[size_t((k + 1) % 6)]});
        EXPECT_EQ(store.rgb(scene.train[size_t(k)])->pixels, pattern(8, 6, 3, k).pixels);
      }
    });
  for (std::thread& thread : threads) thread.join();
}

TEST(FrameStore, UnequalImagesAreRefusedWithBothSizes) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder, 3);
  make_png(folder, "1.png", 8, 7);
  expect_error([&] { FrameStore store(scene); }, {"1.png", "8x7", "8x6"});
}

TEST(FrameStore, AnImageThatFailsInPrefetchIsReportedWhenItIsAskedFor) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder, 3);
  FrameStore store(scene);
  folder.write("2.png", contents(folder.file("2.png")).substr(0, 60));
  store.prefetch({&scene.train[2]});
  expect_error([&] { store.rgb(scene.train[2]); }, {"2.png"});
}

TEST(FrameStore, VideoFramesAreUnpackedOnce) {
  const TemporaryFolder folder;
  const Scene scene = video_scene(folder);
  FrameStoreOptions options;
  options.resolution = 2;
  options.unpack_folder = folder.path() + "/frames";
  FrameStore store(scene, options);
  const auto frame = store.rgb(scene.train[2]);
  EXPECT_EQ(frame->width, 8);
  EXPECT_NEAR(frame->pixels[0], 120, 8);  // the codec changes uniform grey by a few levels only
  const std::string first = folder.path() + "/frames/cam00/00000.png";
  EXPECT_TRUE(std::filesystem::exists(first));
  // A modified file shows that the video is not decoded again.
  write_png(first, pattern(8, 6));
  EXPECT_EQ(store.rgb(scene.train[0])->pixels, pattern(8, 6).pixels);
  EXPECT_NEAR(store.rgb(scene.train[3])->pixels[0], 170, 8);
}

// The video still contains them.
TEST(FrameStore, VideoFramesThatAreDamagedAreUnpackedAgain) {
  const TemporaryFolder folder;
  const Scene scene = video_scene(folder);
  FrameStoreOptions options;
  options.unpack_folder = folder.path() + "/frames";
  const auto pixels = [&] { return FrameStore(scene, options).rgb(scene.train[1])->pixels; };
  const auto whole = pixels();
  const std::string kept = folder.path() + "/frames/cam00/00001.png";
  const std::string bytes = contents(kept);
  std::string flipped = bytes;
  flipped[bytes.size() - 20] = char(flipped[bytes.size() - 20] ^ 1);
  for (const std::string& damaged :
       {std::string(), bytes.substr(0, 20), bytes.substr(0, bytes.size() / 2), flipped}) {
    std::ofstream(kept, std::ios::binary) << damaged;
    testing::internal::CaptureStderr();
    EXPECT_EQ(pixels(), whole) << damaged.size();
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(contents(kept), bytes) << damaged.size();
    EXPECT_NE(said.find(kept), said.npos) << damaged.size() << ": " << said;
    EXPECT_NE(said.find("decoding this frame from the video again"), said.npos)
        << damaged.size() << ": " << said;
  }
}

// The camera name comes from an untrusted file.
TEST(FrameStore, VideoFramesLieInTheFolderWhateverTheCameraIsCalled) {
  const TemporaryFolder folder;
  Scene scene = video_scene(folder);
  const std::string outside = folder.file("victim");
  for (const std::string& name : {outside, std::string("../../victim")}) {
    scene.cameras[size_t(scene.train[0].camera)].name = name;
    FrameStoreOptions options;
    options.unpack_folder = folder.file("run") + "/frames";
    FrameStore store(scene, options);
    EXPECT_NEAR(store.rgb(scene.train[3])->pixels[0], 170, 8);
    EXPECT_FALSE(std::filesystem::exists(outside));
    for (const auto& made : std::filesystem::directory_iterator(options.unpack_folder))
      EXPECT_EQ(made.path().filename().string().find('/'), std::string::npos);
  }
}

TEST(FrameStore, VideoFramesWithoutAFolderLieInOneThatGoesWithTheStore) {
  const TemporaryFolder folder, temporary;
  const Environment there("TMPDIR", temporary.path());
  const Scene scene = video_scene(folder);
  {
    FrameStore store(scene);
    EXPECT_NEAR(store.rgb(scene.train[3])->pixels[0], 170, 8);
    EXPECT_NEAR(store.rgb(scene.train[1])->pixels[0], 70, 8);
    EXPECT_EQ(temporary.count(), 4u);
  }
  EXPECT_TRUE(std::filesystem::is_empty(temporary.path()));
  EXPECT_EQ(folder.count(), 1u);
}

TEST(FrameStore, OnlyVideoFramesOfTheSceneAreUnpacked) {
  const TemporaryFolder folder;
  Scene scene = video_scene(folder);
  scene.train = {scene.train[1], scene.train[3]};
  FrameStoreOptions options;
  options.unpack_folder = folder.path() + "/frames";
  FrameStore store(scene, options);
  EXPECT_NEAR(store.rgb(scene.train[1])->pixels[0], 170, 8);
  EXPECT_NEAR(store.rgb(scene.train[0])->pixels[0], 70, 8);
  EXPECT_EQ(folder.count(), 3u);  // the video and two frames
}

TEST(FrameStore, AMaskIsAlphaTimesTheImagesOwn) {
  const TemporaryFolder folder;
  for (const int channels : {3, 4}) {
    Scene scene = make_scene(folder, channels);
    const Image mask = pattern(8, 6, 1, 7);
    write_png(folder.file("masks/m.png"), mask);
    scene.train[1].mask_path = folder.file("masks/m.png");
    FrameStore store(scene);
    const Image plain = pattern(8, 6, channels, 1);
    const auto rgba = store.image(scene.train[1]);
    ASSERT_EQ(rgba->channels, 4);
    for (size_t i = 0; i < 48; ++i) {
      const double own = channels == 4 ? plain.pixels[4 * i + 3] : 255;
      EXPECT_NEAR(rgba->pixels[4 * i + 3], own * mask.pixels[i] / 255, 0.5) << i;
      EXPECT_EQ(rgba->pixels[4 * i + 1], plain.pixels[size_t(channels) * i + 1]);
    }
    EXPECT_EQ(store.rgb(scene.train[1])->pixels, over_background(*rgba, {255, 255, 255}).pixels);
  }
}

TEST(FrameStore, AMaskOfZerosAndOnesIsWhole) {
  const TemporaryFolder folder;
  Scene scene = make_scene(folder, 3);
  Image mask{8, 6, 1, std::vector<uint8_t>(48)};
  mask.pixels[5] = 1;
  write_png(folder.file("masks/m.png"), mask);
  scene.train[0].mask_path = folder.file("masks/m.png");
  FrameStore store(scene);
  EXPECT_EQ(store.alpha(scene.train[0])->pixels[5], 255);
  EXPECT_EQ(store.alpha(scene.train[0])->pixels[6], 0);
}

// A pixel of the reduced image counts if all its pixels do.
TEST(FrameStore, AMaskMaySayWhichPixelsCount) {
  const TemporaryFolder folder;
  Scene scene = make_scene(folder, 3);
  Image mask{8, 6, 1, std::vector<uint8_t>(48, 255)};
  mask.pixels[8 + 2] = 0;  // x 2, y 1
  write_png(folder.file("masks/m.png"), mask);
  scene.train[0].mask_path = folder.file("masks/m.png");
  scene.masks = Masks::ignore;
  FrameStore store(scene);
  EXPECT_EQ(store.rgb(scene.train[0])->channels, 3);
  EXPECT_EQ(store.alpha(scene.train[0]), nullptr);
  EXPECT_EQ(store.counted(scene.train[0])->pixels, mask.pixels);
  EXPECT_EQ(store.counted(scene.train[1]), nullptr);
  FrameStoreOptions options;
  options.resolution = 2;
  FrameStore half(scene, options);
  const auto counted = half.counted(scene.train[0]);
  ASSERT_EQ(counted->pixels.size(), 12u);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(counted->pixels[i], i == 1 ? 0 : 255) << i;

  // Twice as large, in the alpha channel of an image of one colour.
  Image large{16, 12, 4, {}};
  for (size_t i = 0; i < 16 * 12; ++i) {
    const uint8_t alpha = mask.pixels[i / 32 * 8 + i % 16 / 2];
    large.pixels.insert(large.pixels.end(), {9, 9, 9, alpha});
  }
  write_png(folder.file("masks/large.png"), large);
  scene.train[0].mask_path = folder.file("masks/large.png");
  EXPECT_EQ(FrameStore(scene).counted(scene.train[0])->pixels, mask.pixels);
}

TEST(FrameStore, AMaskThatIsBlackEverywhereIsTold) {
  const TemporaryFolder folder;
  Scene scene = make_scene(folder, 3);
  write_png(folder.file("masks/black.png"), {8, 6, 1, std::vector<uint8_t>(48)});
  scene.train[0].mask_path = folder.file("masks/black.png");
  scene.masks = Masks::ignore;
  FrameStore store(scene);
  testing::internal::CaptureStderr();
  store.counted(scene.train[0]);
  EXPECT_NE(testing::internal::GetCapturedStderr().find("black.png is black everywhere"),
            std::string::npos);
}

TEST(FrameStore, AMaskOfAnotherSizeIsRefusedWithBothSizes) {
  const TemporaryFolder folder;
  Scene scene = make_scene(folder, 3);
  make_png(folder, "masks/m.png", 4, 6, 1);
  scene.train[0].mask_path = folder.file("masks/m.png");
  expect_error([&] { FrameStore store(scene); }, {"m.png", "4x6", "8x6"});
}
