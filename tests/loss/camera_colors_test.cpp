// SPDX-License-Identifier: Apache-2.0
// Colours of cameras: the kernels against shared/camera_color.h in double, what is learned from
// images of known exposure, and that a checkpoint continues with the same bits. The gradients are
// in the table of derivatives (tests/stress).
#include "optim/loss/camera_colors.hpp"

#include <cmath>
#include <random>

#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

std::vector<float> random_colors(size_t pixels, uint32_t seed = 1) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform;
  std::vector<float> rgb(3 * pixels);
  for (float& x : rgb) x = uniform(rng);
  return rgb;
}

class CameraColorLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, CameraColorLanes, testing::Values(16, 8, 4, 1));

TEST_P(CameraColorLanes, ShowTheFormulaAtEverySize) {
  Queue queue = test_queue(GetParam());
  CameraColors colors(queue, 2, {});
  std::vector<float> numbers(2 * CAMERA_COLOR_SIZE);
  CameraColor second;
  for (size_t k = 0; k < CAMERA_COLOR_SIZE; ++k)
    second.v[k] = double(numbers[CAMERA_COLOR_SIZE + k] = 0.02f * float(k) - 0.1f);
  colors.colors().values.write(queue, numbers);
  for (const size_t pixels : {1, 5, 17, 1000}) {
    const std::vector<float> rgb = random_colors(pixels);
    const Buffer<float> rendered(queue, rgb, "rgb");
    std::vector<float> shown = colors.show(queue, 0, pixels, rendered).read(queue);
    EXPECT_EQ(shown, rgb);  // nothing learned: each bit
    shown = colors.show(queue, 1, pixels, rendered).read(queue);
    std::vector<double> expected(3 * pixels);
    for (size_t i = 0; i < pixels; ++i) {
      const LaneColor y = camera_color(
          second, {{double(rgb[i]), double(rgb[pixels + i]), double(rgb[2 * pixels + i])}});
      for (size_t c = 0; c < 3; ++c) expected[c * pixels + i] = y.c[c];
    }
    EXPECT_TRUE(all_close(shown, expected, {1e-6, 1e-6}));  // a few roundings
  }
}

// Two cameras of one scene whose exposures differ: one shows 0.9 x, the other 1.1 x. One after the
// other learns by the squared difference.
class TwoExposures {
 public:
  static constexpr size_t pixels = 500;
  explicit TwoExposures(Queue& queue)
      : colors(queue, 2, {1e-3f, 0}), rgb_(queue, random_colors(pixels), "rgb") {}

  void steps(Queue& queue, int first, int last) {
    for (int step = first; step < last; ++step) {
      const size_t camera = size_t(step) % 2;
      const float exposure = camera == 0 ? 0.9f : 1.1f;
      const std::vector<float> rgb = rgb_.read(queue);
      std::vector<float> v = colors.show(queue, camera, pixels, rgb_).read(queue);
      for (size_t i = 0; i < v.size(); ++i) v[i] = (v[i] - exposure * rgb[i]) / float(pixels);
      Buffer<float> v_rgb(queue, v, "v_rgb");
      colors.backward(queue, camera, pixels, rgb_, v_rgb);
      colors.step(queue);
    }
  }

  CameraColors colors;

 private:
  Buffer<float> rgb_;
};

TEST(CameraColors, LearnTheExposureOfEachCamera) {
  Queue queue = test_queue();
  TwoExposures two(queue);
  two.steps(queue, 0, 1200);
  const std::vector<float> numbers = two.colors.colors().values.read(queue);
  for (size_t camera : {0, 1})
    for (size_t k = 0; k < CAMERA_COLOR_SIZE; ++k) {
      const bool gain = k == 0 || k == 5 || k == 10;
      const float expected = !gain ? 0 : camera == 0 ? -0.1f : 0.1f;
      // Adam steps of 1e-3 do not settle closer than about ten of them
      EXPECT_NEAR(numbers[CAMERA_COLOR_SIZE * camera + k], expected, 0.01) << camera << " " << k;
    }
  for (size_t k = 0; k < CAMERA_COLOR_SIZE; ++k)  // the mean of the cameras is 0
    EXPECT_NEAR(numbers[k] + numbers[CAMERA_COLOR_SIZE + k], 0, 1e-7);
}

TEST(CameraColors, ContinueFromTheirStateWithTheSameBits) {
  Queue queue = test_queue();
  TwoExposures whole(queue), first(queue), then(queue);
  whole.steps(queue, 0, 31);
  first.steps(queue, 0, 14);
  Arrays state;
  first.colors.save_state(queue, state);
  then.colors.load_state(queue, state, "state.npz");
  then.steps(queue, 14, 31);
  EXPECT_EQ(then.colors.colors().values.read(queue), whole.colors.colors().values.read(queue));
  Arrays other;
  CameraColors(queue, 3, {}).save_state(queue, other);
  EXPECT_THROW(first.colors.load_state(queue, other, "state.npz"), Error);
}

TEST(CameraColors, DoNotFollowAGradientThatIsNotFinite) {
  Queue queue = test_queue();
  CameraColors colors(queue, 2, {});
  const Buffer<float> rgb(queue, random_colors(20), "rgb");
  Buffer<float> v_rgb(queue, std::vector<float>(60, INFINITY), "v_rgb");
  colors.backward(queue, 0, 20, rgb, v_rgb);
  colors.step(queue);
  EXPECT_EQ(colors.colors().values.read(queue), std::vector<float>(2 * CAMERA_COLOR_SIZE, 0.f));
}

}  // namespace
}  // namespace gflow
