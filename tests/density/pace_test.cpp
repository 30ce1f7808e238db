// SPDX-License-Identifier: Apache-2.0
// Learning rates of Gaussians in every motion model: (length of the video / visible time)^power.
#include "optim/motion/models.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

class PaceOf : public testing::TestWithParam<MotionModelKind> {};
INSTANTIATE_TEST_SUITE_P(Motion, PaceOf,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& info) { return std::string(name_of(info.param)); });

// Visible for 4.9 lifetimes in a video of length 10; for the fourth lifetime that exceeds the
// video.
TEST_P(PaceOf, FollowsTheLifeUpToTheMost) {
  Queue queue = test_queue();
  MotionShape shape;
  shape.motion = GetParam();
  shape.hexplane.times = 16;
  shape.duration = 10;
  shape.keys = 3;
  shape.bases = 2;
  const auto motion = make_motion(queue, shape);
  Parameters p(queue, 4, motion->groups(), motion->tables());
  std::vector<float> log_scales(16, 0.7f);
  const double lives[] = {.01, .5, 1, 30};
  for (size_t i = 0; i < 4; ++i) log_scales[4 * i + 3] = float(std::log(lives[i]));
  p["log_scales"].values.write(queue, log_scales);
  for (const float power : {1.f, .5f}) {
    motion->set_rate_scales(queue, p, {10, .5f, power, 8});
    std::vector<double> expected;
    for (const double life : lives)
      expected.push_back(std::clamp(std::pow(10 / (4.9 * life), double(power)), 1., 8.));
    EXPECT_TRUE(
        all_close(p.rows.rate_scale.read(queue), expected, {2e-6, 0}));  // pow on the device
  }
}

}  // namespace
}  // namespace gflow
