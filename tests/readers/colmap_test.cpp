// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

template <class T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

// A model of two images and one point, by COLMAP's documentation of the formats.
void make_text(const TemporaryFolder& folder) {
  folder.write("sparse/0/cameras.txt", "# comment\n7 SIMPLE_PINHOLE 8 6 10 4 3\n");
  folder.write("sparse/0/images.txt",
               "# comment\n2 1 0 0 0 0 0 5 7 b.png\n1.5 2.5 1\n"
               "1 0 0 0 2 1 2 3 7 a.png\n\n");
  folder.write("sparse/0/points3D.txt", "# comment\n1 0.5 -1 2 10 20 30 0.1 2 0\n");
}

void make_binary(const TemporaryFolder& folder, int32_t model = 1) {
  std::string cameras =
      raw(uint64_t(1)) + raw(uint32_t(7)) + raw(model) + raw(uint64_t(8)) + raw(uint64_t(6));
  for (double p : {10., 10., 4., 3.}) cameras += raw(p);
  folder.write("sparse/0/cameras.bin", cameras);
  std::string images = raw(uint64_t(2));
  images += raw(uint32_t(2));
  for (double p : {1., 0., 0., 0., 0., 0., 5.}) images += raw(p);
  images += raw(uint32_t(7)) + std::string("b.png") + '\0' + raw(uint64_t(1)) + raw(1.5) +
            raw(2.5) + raw(uint64_t(1));
  images += raw(uint32_t(1));
  for (double p : {0., 0., 0., 2., 1., 2., 3.}) images += raw(p);
  images += raw(uint32_t(7)) + std::string("a.png") + '\0' + raw(uint64_t(0));
  folder.write("sparse/0/images.bin", images);
  std::string points = raw(uint64_t(1)) + raw(uint64_t(1)) + raw(0.5) + raw(-1.0) + raw(2.0);
  points += std::string("\x0a\x14\x1e") + raw(0.1) + raw(uint64_t(1)) + raw(uint32_t(2)) +
            raw(uint32_t(0));
  folder.write("sparse/0/points3D.bin", points);
}

void expect_the_model(const ColmapModel& model) {
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_EQ(model.images[0].name, "a.png");
  const Camera& a = model.images[0].camera;
  EXPECT_EQ(a.fy, 10);
  EXPECT_EQ(a.cx, 4);
  Eigen::Matrix4d expected;  // a rotation by 180 degrees about z, translation 1 2 3
  expected << -1, 0, 0, 1, 0, -1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1;
  EXPECT_TRUE(a.viewmat.isApprox(expected, 1e-12));
  EXPECT_EQ(model.images[1].camera.viewmat(2, 3), 5);
  EXPECT_EQ(model.points.xyz, (std::vector<double>{0.5f, -1, 2}));
  EXPECT_EQ(model.points.rgb, (std::vector<uint8_t>{10, 20, 30}));
}

}  // namespace

TEST(Colmap, ReadsATextModel) {
  const TemporaryFolder folder;
  make_text(folder);
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
}

TEST(Colmap, ReadsATextThatBeginsWithAByteOrderMark) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = fmt::format("sparse/0/{}.txt", name);
    folder.write(file, "\xef\xbb\xbf" + contents(folder.file(file)));
  }
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
}

TEST(Colmap, ReadsABinaryModel) {
  const TemporaryFolder folder;
  make_binary(folder);
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
}

TEST(Colmap, TruncatedBinaryModelsAreRefusedAtEveryLength) {
  const TemporaryFolder folder;
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    make_binary(folder);
    const std::string path = folder.file(std::string("sparse/0/") + name);
    const std::string whole = contents(path);
    for (size_t n = 0; n < whole.size(); ++n) {
      folder.write(std::string("sparse/0/") + name, whole.substr(0, n));
      expect_error([&] { read_colmap_model(folder.file("sparse/0")); }, {name, "truncated"});
    }
  }
}

TEST(Colmap, ModelsThatAreNotKnownAreRefusedByName) {
  const TemporaryFolder folder;
  make_binary(folder, 7);
  expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
               {"cameras.bin", "model FOV", "PINHOLE", "OPENCV_FISHEYE", "image_undistorter"});
  make_binary(folder, 77);
  expect_error([&] { read_colmap_model(folder.file("sparse/0")); }, {"model number 77"});
}

TEST(Colmap, EveryDistortionHasItsCoefficientsInTheirPlaces) {
  const TemporaryFolder folder;
  const auto camera_of = [&](const std::string& model, const std::string& parameters) {
    make_text(folder);
    folder.write("sparse/0/cameras.txt", fmt::format("7 {} 8 6 {}\n", model, parameters));
    return read_colmap_model(folder.file("sparse/0")).images[0].camera;
  };
  using Kind = Lens::Kind;
  using Coefficients = std::array<double, 8>;
  const auto expect = [](const Camera& camera, Kind kind, const Coefficients& k, double fy) {
    EXPECT_EQ(camera.lens.kind, kind);
    EXPECT_EQ(camera.lens.k, k);
    EXPECT_EQ(camera.lens.fx, 10);
    EXPECT_EQ(camera.lens.fy, fy);
    EXPECT_EQ(camera.cx, 4);
    EXPECT_EQ(camera.cy, 3);
  };
  expect(camera_of("SIMPLE_RADIAL", "10 4 3 -.1"), Kind::radial, {-.1}, 10);
  expect(camera_of("RADIAL", "10 4 3 -.1 .02"), Kind::radial, {-.1, .02}, 10);
  expect(camera_of("OPENCV", "10 11 4 3 -.1 .02 .003 .004"), Kind::radial, {-.1, .02, .003, .004},
         11);
  expect(camera_of("FULL_OPENCV", "10 11 4 3 -.1 .02 .003 .004 .05 .06 .07 .08"), Kind::radial,
         {-.1, .02, .003, .004, .05, .06, .07, .08}, 11);
  expect(camera_of("SIMPLE_RADIAL_FISHEYE", "10 4 3 -.1"), Kind::fisheye, {-.1}, 10);
  expect(camera_of("RADIAL_FISHEYE", "10 4 3 -.1 .02"), Kind::fisheye, {-.1, .02}, 10);
  expect(camera_of("OPENCV_FISHEYE", "10 11 4 3 -.1 .02 .003 .004"), Kind::fisheye,
         {-.1, .02, .003, .004}, 11);
  EXPECT_EQ(camera_of("RADIAL", "10 4 3 0 0").lens.kind, Kind::none);
  expect_error([&] { camera_of("RADIAL", "10 4 3 .1"); },
               {"line 1 of", "cameras.txt ends before one of the 5 parameters of RADIAL",
                "CAMERA_ID MODEL"});
}

TEST(Colmap, ImagesOfAnotherSizeKeepTheirLens) {
  const TemporaryFolder folder;
  make_text(folder);
  folder.write("sparse/0/cameras.txt", "7 SIMPLE_RADIAL 1616 1200 2000 808 600 -.1\n");
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  const Camera camera = read_scene(folder.path()).cameras[0];
  EXPECT_EQ(camera.width, 8);
  // 1/202 as wide and 1/200 as high
  EXPECT_NEAR(camera.fx, 2000. / 202, 1e-12);
  EXPECT_NEAR(camera.fy, 10, 1e-12);
  EXPECT_NEAR(camera.lens.fx, 2000. / 202, 1e-12);
  EXPECT_NEAR(camera.lens.cx, 4, 1e-12);
  EXPECT_NEAR(camera.lens.cy, 3, 1e-12);
}

TEST(Colmap, ObservationsOfAnImageAreSteppedOver) {
  const TemporaryFolder folder;
  make_text(folder);
  std::string observed = "nan nan -1 ";
  for (int i = 0; i < 200000; ++i) observed += "100.5 200.5 " + std::to_string(i) + " ";
  folder.write("sparse/0/images.txt",
               "2 1 0 0 0 0 0 5 7 b.png\n# comment\n" + observed + "\n1 0 0 0 2 1 2 3 7 a.png");
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
}

TEST(Colmap, BlankLinesAndCommentsMayBeAnywhereInATextModel) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = fmt::format("sparse/0/{}.txt", name);
    std::string spread = " \t\n\r\n";
    for (const char c : contents(folder.file(file)))
      spread += c == '\n' ? " \t\n  # comment\n\n \r\n#\n" : std::string(1, c);
    folder.write(file, spread);
  }
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
}

// Otherwise an image would be taken for observations.
TEST(Colmap, AfterABlankLineAnImageWithoutANameIsRefused) {
  const TemporaryFolder folder;
  make_text(folder);
  folder.write("sparse/0/images.txt", "2 1 0 0 0 0 0 5 7 b.png\n\n1 0.5 0.5 0.5 0.5 1.5 2 3 7\n\n");
  expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
               {"line 3 of", "ends before the image name"});
}

TEST(Colmap, AnImageInPlaceOfObservationsIsToldNotSteppedOver) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const char* second : {"1 0 0 0 2 1 2 3 7 a.png", "1 0 0 0 2 1 2 3 7 17", "1.5 2.5", "# 1\nx",
                             "1 0 0 0 2 1 2 3 7 d e f.png"}) {
    folder.write("sparse/0/images.txt", std::string("2 1 0 0 0 0 0 5 7 b.png\n") + second + "\n");
    expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
                 {"images.txt", "line after image b.png", "needs two lines"});
  }
}

TEST(Colmap, PointsWithoutAPlaceAreLeftOutAndTracksMayBeLong) {
  const TemporaryFolder folder;
  make_text(folder);
  std::string track;
  for (int i = 0; i < 200000; ++i) track += " 2 " + std::to_string(i);
  folder.write("sparse/0/points3D.txt", "1 0.5 -1 2 10 20 30 0.1" + track + "\n");
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
  const std::string good = "1 0.5 -1 2 10 20 30 0.1 2 0\n", bad = "1 0.5 1e19 2 10 20 30 0.1 2 0\n";
  folder.write("sparse/0/points3D.txt", bad + good);
  testing::internal::CaptureStderr();
  expect_the_model(read_colmap_model(folder.file("sparse/0")));
  EXPECT_NE(testing::internal::GetCapturedStderr().find("1 of the 2 points in"), std::string::npos);
  folder.write("sparse/0/points3D.txt", bad);
  expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
               {"1 of the 1 points in", "points3D.txt", "NaN, infinite or beyond 1e+18"});
  for (const char* colour : {"256 20 30", "10 -9 30"}) {
    folder.write("sparse/0/points3D.txt", fmt::format("1 0.5 1 2 {} 0.1 2 0\n", colour));
    expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
                 {"points3D.txt", std::string("colour ") + colour, "0 to 255"});
  }
}

// They must not be read as their leading 0.
TEST(Colmap, HexadecimalNumbersAreRefused) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const auto& [point, what] : {std::pair("1 0x1p3 -1 2 10 20 30 0.1", "coordinate"),
                                    std::pair("1 0.5 -1 2 10 20 0x1p3 0.1", "colour component")}) {
    folder.write("sparse/0/points3D.txt", "# one\n" + std::string(point) + " 2 0\n");
    expect_error([&] { read_colmap_points(folder.file("sparse/0")); },
                 {"line 2 of", fmt::format("points3D.txt has '0x1p3' as a {}", what),
                  "POINT3D_ID X Y Z R G B"});
  }
  for (const char* camera : {"7 SIMPLE_PINHOLE 8 6 0x3 4 3", "7 SIMPLE_PINHOLE 8 6 10 4 0x3"}) {
    folder.write("sparse/0/cameras.txt", std::string(camera) + "\n");
    expect_error([&] { read_colmap_model(folder.file("sparse/0")); },
                 {"line 1 of", "cameras.txt has '0x3' as", "a finite number"});
  }
}

TEST(Colmap, AWordThatIsNoNumberIsNamedWithItsLine) {
  const TemporaryFolder folder;
  make_text(folder);
  const auto points = [&] { read_colmap_points(folder.file("sparse/0")); };
  for (const char* word : {"1.5", "2800000000000000", "x", "1e1"}) {
    folder.write("sparse/0/points3D.txt",
                 fmt::format("# a\n\n1 0 0 0 1 2 3 0\n2 0 0 0 1 {} 3 0\n", word));
    expect_error(points,
                 {"line 4 of", fmt::format("'{}'", word), "a colour component", "an integer"});
  }
  for (const char* word : {"nan", "inf", "1e400", "1,5", "-"}) {
    folder.write("sparse/0/points3D.txt", fmt::format("1 0 {} 0 1 2 3 0\n", word));
    expect_error(points,
                 {"line 1 of", fmt::format("'{}'", word), "a coordinate", "a finite number"});
  }
  for (const char* tiny : {"-1e-400", "1E-400"}) {
    folder.write("sparse/0/points3D.txt", fmt::format("1 0 {} 0 1 2 3 0\r\n", tiny));
    EXPECT_EQ(read_colmap_points(folder.file("sparse/0")).xyz[1], 0);
  }
}

TEST(Colmap, WhatIsThereTwiceOrTooMuchIsRefused) {
  const TemporaryFolder folder;
  make_text(folder);
  const auto read = [&] { read_colmap_model(folder.file("sparse/0")); };
  folder.write("sparse/0/images.txt", "1 1 0 0 0 0 0 0 7 a.png\n\n1 1 0 0 0 0 0 0 7 b.png\n\n");
  expect_error(read, {"images.txt has image 1 twice"});
  for (const char* none : {"", "# nothing\n"}) {
    folder.write("sparse/0/images.txt", none);
    expect_error(read, {"images.txt has no images"});
  }
  for (const char* q : {"0 0 0 0", "1e-200 0 0 0", "1e200 1e200 0 0"}) {
    folder.write("sparse/0/images.txt", fmt::format("1 {} 0 0 0 7 a.png\n\n", q));
    expect_error(read, {"quaternion of image a.png", "has length", "expected 1"});
  }
  for (const char* name : {"cameras", "images", "points3D"}) {
    make_binary(folder);
    const std::string file = fmt::format("sparse/0/{}.bin", name);
    folder.write(file, contents(folder.file(file)) + std::string(7, '\0'));
    expect_error(read, {file, "7 bytes follow its last record"});
  }
}

TEST(Colmap, MoreImagesThanASceneHasAreRefused) {
  const TemporaryFolder folder;
  make_text(folder);
  std::string cameras, images;
  for (int i = 0; i <= 100000; ++i) {
    cameras += std::to_string(i) + " SIMPLE_PINHOLE 8 6 10 4 3\n";
    images += std::to_string(i) + " 1 0 0 0 0 0 5 7 b.png\n\n";
  }
  folder.write("sparse/0/images.txt", images);
  const auto read = [&] { read_colmap_model(folder.file("sparse/0")); };
  expect_error(read, {"images.txt", "more than 100000 images"});
  folder.write("sparse/0/cameras.txt", cameras);
  expect_error(read, {"cameras.txt", "more than 100000 cameras"});

  make_binary(folder);
  const std::string many = raw(uint64_t(100001)) + std::string(100001 * 64, '\0');
  folder.write("sparse/0/images.bin", many);
  expect_error(read, {"images.bin", "more than 100000 images"});
  folder.write("sparse/0/cameras.bin", many);
  expect_error(read, {"cameras.bin", "more than 100000 cameras"});
}

// Read as a whole, a text file took up to sixteen times its size.
TEST(Colmap, ReadingPointsTakesTheMemoryOfWhatIsMadeOfThem) {
  const TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 2000000; ++i) text += "1 0.5 -1 2 10 20 30 0.1 2 0\n";
  folder.write("sparse/0/points3D.txt", text);
  std::string().swap(text);
  const double points_mib = 27 * 2e6 / (1 << 20);
  const auto read = [&] {
    EXPECT_EQ(read_colmap_points(folder.file("sparse/0")).size(), 2000000u);
  };
  EXPECT_LT(memory_of(read), points_mib + 8);
}

TEST(Colmap, MasksBesideTheImagesAreIgnoredPixelsOrAlpha) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  make_png(folder, "masks/a.png", 8, 6, 1);
  make_png(folder, "masks/b.png.png", 8, 6, 1);
  Scene scene = read_scene(folder.path());
  EXPECT_FALSE(scene.has_alpha);
  EXPECT_EQ(scene.masks, Masks::ignore);
  EXPECT_NE(scene.notices.at(0).find("--set scene.masks=alpha"), std::string::npos);
  EXPECT_EQ(std::filesystem::path(scene.test[0].mask_path).filename(), "a.png");
  EXPECT_EQ(std::filesystem::path(scene.train[0].mask_path).filename(), "b.png.png");
  SceneOptions options;
  options.masks = Masks::alpha;
  scene = read_scene(folder.path(), options);
  EXPECT_TRUE(scene.has_alpha);
  EXPECT_EQ(scene.masks, Masks::alpha);
  options.masks = Masks::none;
  scene = read_scene(folder.path(), options);
  EXPECT_FALSE(scene.has_alpha);
  EXPECT_EQ(scene.train[0].mask_path, "");
}

TEST(Colmap, MasksHaveUsualNames) {
  const TemporaryFolder folder;
  make_text(folder);
  folder.write("sparse/0/images.txt", "2 1 0 0 0 0 0 5 7 left/b.jpg\n\n");
  make_png(folder, "images/left/b.jpg");
  SceneOptions options;
  options.test_every = 0;
  options.masks = Masks::ignore;
  for (const char* name : {"mask/left/mask_b.png", "masks/left/mask_b.png", "masks/left/b_mask.png",
                           "masks/left/b.png", "masks/left/b.jpg.mask.png", "masks/left/b.jpg.png",
                           "masks/left/b.jpg"}) {
    make_png(folder, name, 8, 6, 1);  // each one wins over those before
    const Scene scene = read_scene(folder.path(), options);
    EXPECT_EQ(scene.train.at(0).mask_path, folder.file(name));
    EXPECT_TRUE(scene.notices.empty());
  }
}

TEST(Colmap, MasksThatFitNoImageAreTold) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  make_png(folder, "masks/c.png", 8, 6, 1);
  SceneOptions options;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_FALSE(scene.has_alpha);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0],
            "masks in " + folder.file("masks") +
                " are not used: none is named like an image (expected NAME.png, NAME.jpg.png, "
                "NAME_mask.png or mask_NAME.png)");
  options.masks = Masks::none;
  EXPECT_TRUE(read_scene(folder.path(), options).notices.empty());
}

TEST(Colmap, WhatColmapWasGivenIsNoInputView) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  make_png(folder, "input/0.png");
  EXPECT_EQ(read_scene(folder.path()).layout, "colmap");
}

TEST(Colmap, ModelsThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  const auto read = [&] { read_colmap_model(folder.file("sparse/0")); };
  make_text(folder);
  folder.write("sparse/0/images.txt", "1 1 0 0 0 0 0 0 9 a.png\n\n");
  expect_error(read, {"images.txt", "a.png", "camera 9"});
  folder.write("sparse/0/images.txt", "1 1 0 0 0 nan 0 0 7 a.png\n\n");
  expect_error(read, {"images.txt"});
  folder.write("sparse/0/images.txt", "1 0 0 0 0 0 0 0 7 a.png\n\n");
  expect_error(read, {"a.png", "length 0"});
  folder.write("sparse/0/images.txt", "1 1 0 0\n");
  expect_error(read, {"line 1 of", "images.txt ends before a quaternion component", "IMAGE_ID QW"});
  make_text(folder);
  folder.write("sparse/0/cameras.txt",
               "7 SIMPLE_PINHOLE 8 6 10 4 3\n7 SIMPLE_PINHOLE 8 6 20 4 3\n");
  expect_error(read, {"cameras.txt", "camera 7 twice"});
  folder.write("sparse/0/cameras.txt", "7 SIMPLE_PINHOLE 8 6 10 4 3 0.1 \n");
  expect_error(read, {"cameras.txt", "more than the 3 parameters of its model SIMPLE_PINHOLE"});
  folder.write("sparse/0/cameras.txt", "7 SIMPLE_PINHOLE 8 6 10 4 3 \n");
  EXPECT_NO_THROW(read());
  std::filesystem::remove(folder.file("sparse/0/cameras.txt"));
  expect_error(read, {"neither cameras.bin nor cameras.txt"});
}

TEST(Colmap, NamesThatAreNoneAreShownInOneShortLine) {
  const TemporaryFolder folder;
  make_binary(folder);
  const std::string model = contents(folder.file("sparse/0/images.bin"));
  make_png(folder, "images/a.png");
  const auto expect_in_one_line = [&](const std::string& name, const char* shown) {
    std::string images = model;
    folder.write("sparse/0/images.bin", images.replace(images.find("b.png"), 5, name));
    try {
      read_scene(folder.path());
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      const std::string message = error.what();
      EXPECT_NE(message.find(shown), std::string::npos) << message;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
      EXPECT_LT(message.size(), 400u) << message;
    }
  };
  expect_in_one_line("b\nred.png", "'b\\x0ared.png'");
  expect_in_one_line(std::string(4000, 'b'), "bbb...'");
}

TEST(Colmap, AFolderOfImagesIsAStaticScene) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "colmap");
  EXPECT_EQ(scene.steps, 1);
  ASSERT_EQ(scene.test.size(), 1u);
  EXPECT_EQ(scene.test[0].name, "a");
  EXPECT_EQ(scene.train[0].name, "b");
  EXPECT_EQ(scene.points.size(), 1u);
  make_png(folder, "input/a.png");
  EXPECT_EQ(read_scene(folder.path()).train[0].path, folder.file("images/b.png"));
  std::string images = contents(folder.file("sparse/0/images.txt"));
  images.replace(images.find("b.png"), 5, "a.png");
  folder.write("sparse/0/images.txt", images);
  expect_error([&] { read_scene(folder.path()); }, {"sparse/0", "a.png twice"});
}

// Output files are named after it.
TEST(Colmap, AnImageInAFolderHasANameWithout) {
  const TemporaryFolder folder;
  make_text(folder);
  const std::string deep = std::string(180, 'd') + "/" + std::string(90, 'd');
  folder.write("sparse/0/images.txt",
               fmt::format("1 1 0 0 0 0 0 5 7 {}.png\n\n2 1 0 0 0 0 0 5 7 sub/b.png\n\n", deep));
  make_png(folder, fmt::format("images/{}.png", deep));
  make_png(folder, "images/sub/b.png");
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.train.at(0).name, "sub_b");
  EXPECT_EQ(scene.test.at(0).name.size(), 100u + 17);  // truncated, with a hash
}

// As written by colmap image_undistorter.
TEST(Colmap, AModelMayBeInSparseItself) {
  const TemporaryFolder folder;
  for (const bool binary : {false, true}) {
    std::filesystem::remove_all(folder.file("sparse"));
    if (binary)
      make_binary(folder);
    else
      make_text(folder);
    std::filesystem::rename(folder.file("sparse/0"), folder.file("moved"));
    std::filesystem::remove(folder.file("sparse"));
    std::filesystem::rename(folder.file("moved"), folder.file("sparse"));
    make_png(folder, "images/a.png");
    make_png(folder, "images/b.png");
    make_png(folder, "input/0.png");
    const Scene scene = read_scene(folder.path());
    EXPECT_EQ(scene.layout, "colmap");
    EXPECT_EQ(scene.train.size(), 1u);
    EXPECT_EQ(scene.points.size(), 1u);
    EXPECT_TRUE(scene.notices.empty());
  }
}

TEST(Colmap, OfSeveralModelsTheOneWithMostImagesIsReadAndTold) {
  const TemporaryFolder folder;
  make_text(folder);
  std::filesystem::rename(folder.file("sparse/0"), folder.file("sparse/10"));
  folder.write("sparse/2/cameras.txt", "7 FOV 8 6 10 10 4 3 0.1\n");  // not read
  folder.write("sparse/2/images.txt", "1 1 0 0 0 0 0 0 7 c.png\n\n");
  folder.write("sparse/2/points3D.txt", "");
  folder.write("sparse/log/cameras.txt", "no model");
  for (const char* name : {"a", "b", "c"}) make_png(folder, fmt::format("images/{}.png", name));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.cameras.size(), 2u);
  ASSERT_FALSE(scene.notices.empty());
  EXPECT_EQ(scene.notices[0],
            fmt::format("using COLMAP model {0}/sparse/10 with 2 registered images; not used: "
                        "{0}/sparse/2 with 1",
                        folder.path()));
}

TEST(Colmap, PointsMayBeAPlyOrMissing) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  write_point_cloud(folder.file("sparse/0/points3D.ply"), {{1, 2, 3}, {4, 5, 6}});
  EXPECT_EQ(read_scene(folder.path()).points.xyz, (std::vector<double>{0.5, -1, 2}));
  std::filesystem::remove(folder.file("sparse/0/points3D.txt"));
  EXPECT_EQ(read_scene(folder.path()).points.xyz, (std::vector<double>{1, 2, 3}));
  EXPECT_TRUE(read_scene(folder.path()).notices.empty());
  std::filesystem::remove(folder.file("sparse/0/points3D.ply"));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.size(), 0u);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0], "COLMAP model " + folder.file("sparse/0") +
                                  " has no points3D file: starting without "
                                  "its points");
  write_point_cloud(folder.file("points3D.ply"), {{7, 8, 9}, {4, 5, 6}});
  EXPECT_EQ(read_scene(folder.path()).points.xyz, (std::vector<double>{7, 8, 9}));
}

TEST(Colmap, PointsThatNoCameraSeesAreTold) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  PointCloud points;
  const Scene before = read_scene(folder.path());
  const Camera camera = before.cameras[size_t(before.train[0].camera)];
  const Eigen::Vector3d middle((0.5 * camera.width - camera.cx) / camera.fx,
                               (0.5 * camera.height - camera.cy) / camera.fy, 1);
  const Eigen::Vector3d ahead = camera.viewmat.topLeftCorner<3, 3>().transpose() * middle;
  for (const double side : {1., -1., -1.})  // a third before the camera
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d at = camera.position() + side * (2 + i) * ahead;
      points.xyz.insert(points.xyz.end(), at.data(), at.data() + 3);
    }
  points.rgb.assign(points.xyz.size(), 100);
  std::filesystem::remove(folder.file("sparse/0/points3D.txt"));
  write_point_cloud(folder.file("sparse/0/points3D.ply"), points);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.source, folder.file("sparse/0/points3D.ply"));
  EXPECT_NEAR(share_of_points_in_view(scene), 1 / 3., 1e-12);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0].rfind("only ", 0), 0u);
  EXPECT_NE(scene.notices[0].find("points3D.ply are in view"), std::string::npos);
}

TEST(Colmap, AModelOfConvertPyHasItsImagesInInput) {
  const TemporaryFolder folder;
  make_text(folder);
  std::filesystem::create_directories(folder.file("distorted"));
  std::filesystem::rename(folder.file("sparse"), folder.file("distorted/sparse"));
  make_png(folder, "input/a.png");
  make_png(folder, "input/b.png");
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "colmap");
  EXPECT_EQ(scene.train[0].path, folder.file("input/b.png"));
}

TEST(Colmap, ASceneInAnotherFolderIsNamed) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const char* name : {"images/a.png", "images/b.png", "images/1.png"}) make_png(folder, name);
  const Scene images = read_scene(folder.file("images"));  // numbered: a video without poses
  ASSERT_EQ(images.notices.size(), 2u);
  EXPECT_NE(images.notices[0].find("no camera poses"), std::string::npos);
  EXPECT_NE(images.notices[1].find(folder.path() + ", is a scene with camera poses (colmap)"),
            std::string::npos);
  const TemporaryFolder outer;
  std::filesystem::create_directories(outer.file("one"));
  std::filesystem::copy(folder.path(), outer.file("one/two"),
                        std::filesystem::copy_options::recursive);
  expect_error([&] { read_scene(outer.path()); },
               {"no known scene layout", outer.file("one/two") + " (colmap)"});
}

TEST(Colmap, MasksOfSomeImagesAreCounted) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  make_png(folder, "masks/b.png", 16, 12, 1);
  const Scene scene = read_scene(folder.path());
  ASSERT_EQ(scene.notices.size(), 2u);
  EXPECT_EQ(scene.notices[0], "1 of 2 images have a mask; in the others all pixels count");
}

TEST(Colmap, ImagesThatAreNotRegisteredAreCountedAndTold) {
  const TemporaryFolder folder;
  make_text(folder);
  for (const char* name : {"a.png", "b.png", "c.png", "more/d.JPG", ".hidden/e.png", "notes.txt"})
    make_png(folder, std::string("images/") + name);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.cameras.size(), 2u);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0],
            fmt::format("2 of 4 images in {0}/images are left out: they are not registered in "
                        "{0}/sparse/0",
                        folder.path()));
}

TEST(Colmap, ReducedImagesAreSelectedAndTheirCamerasFollow) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  make_png(folder, "images_2/a.png", 4, 3);
  make_png(folder, "images_2/b.jpg", 4, 3);
  SceneOptions options;
  options.images = "images_2";
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_TRUE(scene.notices.empty());
  for (const Camera& camera : scene.cameras) {
    EXPECT_EQ(camera.width, 4);
    EXPECT_NEAR(camera.fx, 5, 1e-12);
    EXPECT_NEAR(camera.cy, 1.5, 1e-12);
  }
  options.images = "images_4";
  expect_error([&] { read_scene(folder.path(), options); },
               {"no folder", "images_4", "scene.images selects another: images, images_2"});
}

TEST(Colmap, ImagesMayBeLeftOutByName) {
  const TemporaryFolder folder;
  make_text(folder);
  make_png(folder, "images/a.png");
  make_png(folder, "images/b.png");
  SceneOptions options;
  for (const char* name : {"b", "b.png"}) {
    options.skip_cameras = name;
    options.test_every = 0;
    EXPECT_EQ(read_scene(folder.path(), options).cameras.at(0).name, "a.png");
    options.test_every = 8;
    expect_error([&] { read_scene(folder.path(), options); }, {"leaves no training images"});
  }
  options.skip_cameras = "a";
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.train.at(0).name, "b");
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0], "scene.skip_cameras leaves no test views");
}

TEST(Colmap, NamesOfWindowsHaveSlashes) {
  const TemporaryFolder folder;
  make_text(folder);
  folder.write("sparse/0/images.txt",
               "1 1 0 0 0 0 0 5 7 left\\a.png\n\n2 1 0 0 0 0 0 5 7 left\\b.png\n\n");
  make_png(folder, "images/left/a.png");
  make_png(folder, "images/left/b.png");
  make_png(folder, "masks/left/b.png", 8, 6, 1);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.train.at(0).path, folder.file("images/left/b.png"));
  EXPECT_EQ(scene.train.at(0).name, "left_b");
  EXPECT_EQ(scene.train.at(0).mask_path, folder.file("masks/left/b.png"));
  folder.write("sparse/0/images.txt", "1 1 0 0 0 0 0 5 7 ..\\..\\a.png\n\n");
  expect_error([&] { read_scene(folder.path()); }, {"outside of the scene folder"});
}

TEST(Scene, WithoutAPathSaysWhichSettingIsEmpty) {
  expect_error([] { read_scene(""); }, {"scene.path is empty", "folder or a video"});
}

TEST(Scene, AnUnknownLayoutSaysWhatWasLookedFor) {
  const TemporaryFolder folder;
  expect_error([&] { read_scene(folder.path()); },
               {folder.path(), "poses_bounds.npy", "transforms_train.json", "transforms.json",
                "train_meta.json", "dataset.json", "sparse/0", "0.png", "video"});
  expect_error([&] { read_scene(folder.path() + "/none"); }, {"no such scene folder"});
}
