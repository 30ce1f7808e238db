// SPDX-License-Identifier: Apache-2.0
// Shared rigid motions: the effect of a single weight of 1, and the device against double and
// differences.
#include "optim/motion/bases.hpp"

#include <gtest/gtest.h>

#include "shared/motion/bases.h"
#include "tests/support/device.hpp"
#include "tests/support/motion_check.hpp"

namespace gflow {
namespace {

TEST(Bases, GradientOfAPoseEqualsCentralDifferences) {
  Random random(4);
  for (int i = 0; i < 30; ++i) {
    std::vector<double> x(7);  // quat, shift
    for (double& value : x) value = random();
    const real3 m = random.three(), pivot = random.three(), v_mean = random.three();
    const real4 v_turn{random(), random(), random(), random()};
    const double weight = random();
    const auto pose = [&](const std::vector<double>& y) {
      return BasisPose{{y[0], y[1], y[2], y[3]}, {y[4], y[5], y[6]}, pivot};
    };
    const auto loss = [&](const std::vector<double>& y) {
      return weight * (dot(basis_shift(pose(y), m), v_mean) + dot(basis_turn(pose(y)), v_turn));
    };
    const std::vector<double> expected = numeric_gradient(loss, x);
    const BasisPose v = basis_pose_vjp(pose(x), weight, m, v_mean, v_turn);
    EXPECT_TRUE(all_close(std::vector<double>{v.quat.x, v.quat.y, v.quat.z, v.quat.w, v.shift.x,
                                              v.shift.y, v.shift.z},
                          expected, {1e-6, 1e-6 * largest(expected)}));
  }
}

MotionShape shape_of(int keys, int bases) {
  MotionShape shape;
  shape.motion = MotionModelKind::bases;
  shape.duration = 2;
  shape.keys = keys;
  shape.bases = bases;
  return shape;
}

TEST(Bases, WeightsAreASoftmaxBesideALogitOfZeroAndStandLargeLogits) {
  const double logits[] = {1, -2, .5};
  double weights[3];
  basis_weights(3, logits, weights);
  const double sum = 1 + std::exp(1) + std::exp(-2) + std::exp(.5);
  for (int b = 0; b < 3; ++b) EXPECT_NEAR(weights[b], std::exp(logits[b]) / sum, 1e-15);
  const double far[] = {900, -900, 899};
  basis_weights(3, far, weights);
  EXPECT_NEAR(weights[0], 1 / (1 + std::exp(-1)), 1e-12);
  EXPECT_EQ(weights[1], 0);
}

TEST(Bases, OneFullWeightIsThatRigidMotion) {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    Canonical g;
    g.mean = random.three();
    g.quat = random.four();
    BasisPose pose{quat_normalize(random.four()).q, random.three(), random.three()};
    const Canonical moved = blended(g, basis_shift(pose, g.mean), basis_turn(pose));
    const Eigen::Matrix3d r = eigen_quat(pose.quat).toRotationMatrix();
    const Eigen::Vector3d at = r * eigen(g.mean - pose.pivot) + eigen(pose.pivot + pose.shift);
    EXPECT_LT((eigen(moved.mean) - at).norm(), 1e-12);
    const Eigen::Matrix3d before = eigen_quat(g.quat).normalized().toRotationMatrix();
    const Eigen::Matrix3d after = eigen_quat(moved.quat).normalized().toRotationMatrix();
    EXPECT_LT((after - r * before).norm(), 1e-12);
  }
}

// Keys, bases, and lanes: 0 the device's own, 1 as on GPUs.
class BasesOfSomeSizes : public testing::TestWithParam<std::tuple<int, int, int>> {};
INSTANTIATE_TEST_SUITE_P(Motion, BasesOfSomeSizes,
                         testing::Values(std::tuple{1, 1, 0}, std::tuple{5, 1, 0},
                                         std::tuple{4, 3, 0}, std::tuple{3, 32, 0},
                                         std::tuple{4, 3, 1}));

TEST_P(BasesOfSomeSizes, TheDeviceShowsAndDifferentiatesAsTheDoubleFormulas) {
  const auto& [keys, bases, lanes] = GetParam();
  Queue queue = test_queue(lanes);
  const MotionShape shape = shape_of(keys, bases);
  MotionCheck check(
      queue, shape, 150,
      [&](const Named& p, size_t i, double t) { return reference::bases_at(shape, p, i, t); },
      {{"basis_turns", 0.2}});
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0}) check.expect_same_gaussians(t, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5, {"pivots"});  // float32
}

TEST(Bases, PivotsLieFarApartAmongWhatMovesAndGaussiansFollowThoseNear) {
  const MotionShape shape = shape_of(3, 2);
  HostGroups groups;
  groups["means"] = {50, 0, 0, 0, 0, 0, .1f, 0, 0, 5, 0, 0, 5.1f, 0, 0};
  groups["basis_logits"].assign(10, 0.f);
  groups["pivots"].assign(6, 0.f);
  place_bases(shape, groups, 1, groups.at("means").size() / 3);
  EXPECT_EQ(groups["pivots"], (std::vector<float>{0, 0, 0, 5.1f, 0, 0}));
  const auto logit = [&](size_t i, size_t b) { return groups["basis_logits"][2 * i + b]; };
  EXPECT_LT(std::max(logit(0, 0), logit(0, 1)), -5);  // static
  EXPECT_GT(logit(2, 0), 1);
  EXPECT_LT(logit(2, 1), 0);
  EXPECT_GT(logit(3, 1), 1);
}

}  // namespace
}  // namespace gflow
