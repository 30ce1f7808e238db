// SPDX-License-Identifier: Apache-2.0
// Learning rates against the settings, computed by hand.
#include "optim/train/learning_rates.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

class RatesTest : public testing::Test {
 protected:
  // A camera whose pixels are 0.05 scene units at what it looks at, in the distance of the extent.
  static Scene one_camera() {
    Scene scene;
    Camera camera;
    camera.width = camera.height = 100;
    camera.fx = camera.fy = camera.cx = camera.cy = 50;
    scene.cameras = {camera};
    scene.train.resize(1);
    scene.extent = 2.5;
    return scene;
  }
  RatesTest() {
    scene.steps = 5;
    shape.duration = 2;
    config.train.iterations = 100;
    config.lr.steps = 0;
    config.lr.means = 0.1f;
    config.lr.means_final = 0.001f;
    config.lr.quats = 0.4f;
    config.lr.quats_final = 0.1f;
    config.lr.mean_t = 0.03f;
    config.lr.motion = 8;
    config.lr.sh = 0.01f;
    config.lr.sh_rest_divisor = 5;
  }
  float rate(Quantity quantity, int step, bool motion = false) const {
    GroupSpec spec{"a group", 1, quantity};
    spec.motion = motion;
    return rates().of(spec, step).lr;
  }
  Rates rates() const {
    Rates rates{config, scene, shape};
    rates.scale = scale;
    return rates;
  }
  Scene scene = one_camera();
  MotionShape shape;
  TrainOptions config;
  float scale = 1;
};

TEST_F(RatesTest, ThatOfPlacesFallsByEqualRatiosAndIsInExtentsOfTheScene) {
  EXPECT_FLOAT_EQ(rates().position(0), 0.25f);
  EXPECT_FLOAT_EQ(rates().position(50), 0.025f);  // geometric mean of start and end
  EXPECT_NEAR(rates().position(99), 0.0025, 0.00015);
  EXPECT_FLOAT_EQ(rate(Quantity::position, 50), 0.025f);
}

TEST_F(RatesTest, ThatOfRotationsFallsTooOthersStayUpToTheMiddle) {
  EXPECT_FLOAT_EQ(rate(Quantity::rotation, 50), 0.2f);
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 0), config.lr.scales);
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 50), config.lr.scales);
  EXPECT_FLOAT_EQ(rate(Quantity::opacity, 50), config.lr.opacity);
}

TEST_F(RatesTest, FromTheMiddleOnThoseWithoutALastValueFade) {
  config.lr.fade = 0.25f;
  for (const Quantity quantity : {Quantity::scale, Quantity::opacity, Quantity::color,
                                  Quantity::color_rest, Quantity::time, Quantity::weight}) {
    const float before = rate(quantity, 50);
    EXPECT_FLOAT_EQ(rate(quantity, 75), 0.5f * before);  // half way from 1 to a quarter
    EXPECT_FLOAT_EQ(rate(quantity, 0), before);
  }
  const float with = rate(Quantity::position, 75), turning = rate(Quantity::rotation, 75);
  config.lr.fade = 1;
  EXPECT_EQ(rate(Quantity::position, 75), with);
  EXPECT_EQ(rate(Quantity::rotation, 75), turning);
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 99), config.lr.scales);
}

TEST_F(RatesTest, OnePoseForAllTimesHasItsOwn) {
  shape.motion = MotionModelKind::nodes;
  const HexplaneOptions& own = config.motion.hexplane;
  EXPECT_FLOAT_EQ(rate(Quantity::position, 0), 2.5f * own.means);
  EXPECT_FLOAT_EQ(rate(Quantity::position, 100), 0.0025f);  // the last one is common
  EXPECT_FLOAT_EQ(rate(Quantity::opacity, 0), own.opacity);
  EXPECT_FLOAT_EQ(rate(Quantity::rotation, 50), 0.2f);
}

TEST_F(RatesTest, GrowWhereStepsAreFew) {
  config.lr.steps = 200;  // twice those of the training
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 0), 2 * config.lr.scales);
  EXPECT_FLOAT_EQ(rate(Quantity::rotation, 50), 0.4f);
  EXPECT_FLOAT_EQ(rate(Quantity::position, 0), 0.25f);
  EXPECT_FLOAT_EQ(rate(Quantity::position, 100), 0.005f);
  EXPECT_FLOAT_EQ(rate(Quantity::color, 0), 0.01f);
  config.lr.steps = 1000000;  // at most three times
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 0), 3 * config.lr.scales);
  config.lr.steps = 50;  // never smaller
  EXPECT_FLOAT_EQ(rate(Quantity::scale, 0), config.lr.scales);
  config.lr.steps = 200;
  shape.motion = MotionModelKind::nodes;
  EXPECT_FLOAT_EQ(rate(Quantity::position, 0), 5 * config.motion.hexplane.means);
  EXPECT_FLOAT_EQ(rate(Quantity::color, 0), 0.02f);
  EXPECT_FLOAT_EQ(rate(Quantity::opacity, 0), 2 * config.motion.hexplane.opacity);
  EXPECT_FLOAT_EQ(rate(Quantity::plane, 100), 2 * config.lr.planes_final);
  EXPECT_FLOAT_EQ(rate(Quantity::network, 100), 2 * config.lr.network_final);
  for (const MotionModelKind kind : {MotionModelKind::native4d, MotionModelKind::bases}) {
    shape.motion = kind;
    EXPECT_FLOAT_EQ(rate(Quantity::position, 100), 0.005f);
    EXPECT_FLOAT_EQ(rate(Quantity::scale, 0), config.lr.scales);
    EXPECT_FLOAT_EQ(rate(Quantity::rotation, 50), 0.2f);
  }
}

TEST_F(RatesTest, HigherBandsOfColourLearnSlowerByTheirDivisor) {
  EXPECT_FLOAT_EQ(rate(Quantity::color, 50), 0.01f);
  EXPECT_FLOAT_EQ(rate(Quantity::color_rest, 50), 0.002f);
}

TEST_F(RatesTest, MotionLearnsFasterByItsFactorButNotItsTimes) {
  EXPECT_FLOAT_EQ(rate(Quantity::position, 0, true), 2.f);
  EXPECT_FLOAT_EQ(rate(Quantity::time, 0, true), 0.06f);  // in lengths of the video
}

TEST_F(RatesTest, CautionSlowsAllOfThem) {
  scale = 0.5f;
  EXPECT_FLOAT_EQ(rate(Quantity::position, 0), 0.125f);
  EXPECT_FLOAT_EQ(rate(Quantity::color, 0), 0.005f);
}

TEST_F(RatesTest, NoFactorOfPaceMovesAGaussianByMoreThanThreeTenthsOfAPixel) {
  config.lr.motion = 1;
  config.lr.pace_most = 8;
  // extent 2.5 x rate = 0.002 per step = 0.04 px: 7.5 times that are 0.3 px
  config.lr.means = 0.0008f;
  EXPECT_NEAR(rates().pace_most(), 7.5, 1e-4);
  config.lr.means = 0.0004f;
  EXPECT_EQ(rates().pace_most(), 8);
  config.lr.means = 0.1f;
  EXPECT_EQ(rates().pace_most(), 1);
}

}  // namespace
}  // namespace gflow
