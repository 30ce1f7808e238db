// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/lens.hpp"

#include <cmath>

#include "optim/scene/frame_store.hpp"
#include "runtime/base/worse.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

Camera camera_without_lens() {
  Camera camera;
  camera.name = "cam";
  camera.width = 160;
  camera.height = 120;
  camera.fx = 120;
  camera.fy = 126;
  camera.cx = 83;
  camera.cy = 57;
  return camera;
}

// Brightness of the plane z = 1 at (x, y): slow waves keep the interpolation error small.
double scenery(double x, double y) { return 127 + 60 * std::sin(9 * x) + 60 * std::cos(8 * y + x); }

// What the camera records of it through its lens. Finds the ray of each stored pixel by fixed-point
// iteration, which uses the formulas in the opposite direction to the code under test.
Image stored_image(const Camera& camera) {
  const Lens& lens = camera.lens;
  Image image{camera.width, camera.height, 3, {}};
  for (int j = 0; j < camera.height; ++j)
    for (int i = 0; i < camera.width; ++i) {
      const Eigen::Vector2d bent((i + .5 - lens.cx) / lens.fx, (j + .5 - lens.cy) / lens.fy);
      Eigen::Vector2d p = bent;
      for (int n = 0; n < 100; ++n) p += bent - distorted(lens, p);
      image.pixels.insert(image.pixels.end(), 3, uint8_t(std::lround(scenery(p.x(), p.y()))));
    }
  return image;
}

// Maximum difference from the view of a pinhole camera [grey levels].
double worst_error(const Image& image, const Camera& camera) {
  double worst = 0;
  for (int j = 0; j < image.height; ++j)
    for (int i = 0; i < image.width; ++i) {
      const double seen = image.pixels[size_t(3 * (j * image.width + i))];
      const double x = (i + .5 - camera.cx) / camera.fx, y = (j + .5 - camera.cy) / camera.fy;
      worst = worse(worst, std::fabs(seen - scenery(x, y)));
    }
  return worst;
}

}  // namespace

TEST(Lens, FormulasGiveTheValuesWorkedOutByHand) {
  Lens lens;
  lens.kind = Lens::Kind::radial;
  lens.k = {.1, .02, .003, .004, .005, .06, .07, .08};
  // x = 1, y = 2: r^2 = 5; d = (1 + .5 + .5 + .625) / (1 + .3 + 1.75 + 10) = 2.625 / 13.05
  // x' = d + 2 (.003)(2) + .004 (5 + 2), y' = 2 d + .003 (5 + 8) + 2 (.004)(2)
  const Eigen::Vector2d radial = distorted(lens, {1, 2});
  EXPECT_NEAR(radial.x(), 2.625 / 13.05 + 0.012 + 0.028, 1e-12);
  EXPECT_NEAR(radial.y(), 5.25 / 13.05 + 0.039 + 0.016, 1e-12);
  lens.kind = Lens::Kind::fisheye;
  lens.k = {.1, .02, .003, .004};
  // r = 1 along x: a = pi / 4
  const double a = M_PI / 4;
  const double bent = a + .1 * std::pow(a, 3) + .02 * std::pow(a, 5) + .003 * std::pow(a, 7) +
                      .004 * std::pow(a, 9);
  EXPECT_NEAR(distorted(lens, {.6, .8}).x(), .6 * bent, 1e-12);
  EXPECT_NEAR(distorted(lens, {.6, .8}).y(), .8 * bent, 1e-12);
  EXPECT_EQ(distorted(lens, {0, 0}), Eigen::Vector2d(0, 0));
}

TEST(Lens, UndistortedImagesAreThoseOfAPinholeCamera) {
  struct Case {
    Lens::Kind kind;
    std::array<double, 8> k;
  };
  for (const Case& one : {Case{Lens::Kind::radial, {-.2, .03, .002, -.003, .001, 0, 0, 0}},
                          Case{Lens::Kind::radial, {.15, -.02, .001, .002, 0, 0, 0, 0}},
                          Case{Lens::Kind::fisheye, {-.03, .01, 0, 0}}}) {
    const Camera camera = pinhole_of_lens(camera_without_lens(), one.kind, one.k, "cam");
    // 60 levels x (9 / 120)^2 / 8 of linear interpolation and two roundings of half a level: 1.1.
    EXPECT_LT(worst_error(undistorted(stored_image(camera), camera), camera), 1.2)
        << int(one.kind) << " " << one.k[0];
  }
}

TEST(Lens, BarrelKeepsTheFocalLengthAndPincushionLosesTheRim) {
  const Camera barrel = pinhole_of_lens(camera_without_lens(), Lens::Kind::radial, {-.1}, "cam");
  EXPECT_EQ(barrel.fx, 120);
  const Camera pincushion = pinhole_of_lens(camera_without_lens(), Lens::Kind::radial, {.1}, "cam");
  // The farthest corner, (-82.5 / 120, 62.5 / 126), would be 7 % outside: r^2 = 0.72. Zoomed by s:
  // x = 0.6875 / s, and (1 + .1 r^2 / s^2) / s <= 83 / 82.5 gives s of about 1.06, in steps of 1 %.
  EXPECT_GT(pincushion.fx, 1.04 * 120);
  EXPECT_LT(pincushion.fx, 1.08 * 120);
  EXPECT_NEAR(pincushion.fy / pincushion.fx, 126. / 120, 1e-12);
  EXPECT_EQ(pincushion.cx, 83);
}

TEST(Lens, PolynomialsThatTurnBackAreNotFollowedThere) {
  // r (1 - r^2) decreases beyond r = 0.577, inside the image (corner at 0.85): its content is
  // mirrored.
  const Camera camera = pinhole_of_lens(camera_without_lens(), Lens::Kind::radial, {-1}, "cam");
  const double corner = std::hypot(82.5 / camera.fx, 62.5 / camera.fy);
  EXPECT_LT(corner, 0.5774);
}

TEST(Lens, ImpossibleCoefficientsAreRefused) {
  const auto lens = [](double k1) {
    pinhole_of_lens(camera_without_lens(), Lens::Kind::radial, {k1}, "the camera of a.png");
  };
  expect_error([&] { lens(NAN); }, {"the camera of a.png", "NaN or Inf"});
  expect_error([&] { lens(-1000); }, {"the camera of a.png", "too much lens distortion", "-1000"});
}

TEST(Lens, TheImagesOfAStoreAreUndistortedAndThenReduced) {
  const TemporaryFolder folder;
  Scene scene;
  scene.cameras = {
      pinhole_of_lens(camera_without_lens(), Lens::Kind::radial, {.15, -.02, .001, .002}, "cam")};
  write_png(folder.file("a.png"), stored_image(scene.cameras[0]));
  Frame frame;
  frame.path = folder.file("a.png");
  scene.train = {frame};
  FrameStoreOptions options;
  options.resolution = 2;
  FrameStore store(scene, options);
  const Camera& camera = store.camera(frame);
  EXPECT_EQ(camera.lens.kind, Lens::Kind::none);
  EXPECT_EQ(camera.width, 80);
  // A pixel is now the mean of four: adds 60 levels x (9 / 60)^2 / 12.
  EXPECT_LT(worst_error(*store.rgb(frame), camera), 1.6);
}
