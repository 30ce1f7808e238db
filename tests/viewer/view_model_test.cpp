// SPDX-License-Identifier: Apache-2.0
// The viewer's bytes hold the model: its own parameters, or poses as the engine has them.
#include "apps/viewer/view_model.hpp"

#include <Eigen/Dense>

#include "tests/support/lively_model.hpp"
#include "tests/support/random_model.hpp"
#include "tests/viewer/container.hpp"

namespace gflow {
namespace {

Container container_of_model(const HostModel& model,
                             ViewPrecision precision = ViewPrecision::full) {
  return container_of(view_model_bytes(model, nullptr, {}, precision));
}

TEST(ViewModel, HoldsTheGroupsOfModelsThatThePageEvaluatesBitByBit) {
  for (const auto kind : {MotionModelKind::spacetime, MotionModelKind::native4d}) {
    const HostModel model = random_model(5, 2, kind);
    const Container container = container_of_model(model);
    EXPECT_EQ(container.header["motion"], name_of(kind));
    EXPECT_EQ(container.header["count"], 5);
    EXPECT_EQ(container.header["moving"], 5);
    EXPECT_EQ(container.header["duration"], double(model.shape.duration));
    EXPECT_EQ(container.header["cutoff"], double(model.shape.cutoff));
    EXPECT_EQ(container.arrays, HostGroups(model.groups)) << name_of(kind);
  }
}

TEST(ViewModel, HoldsTheKeysOfDynamicGaussiansOnly) {
  HostModel model = random_model(5, 0, MotionModelKind::keyframes);
  model.moving = 2;
  const Container container = container_of_model(model);
  EXPECT_EQ(container.header["keys"], 3);
  EXPECT_EQ(container.header["key_scales"], 1);
  EXPECT_EQ(container.header["arrays"]["key_turns"]["shape"], (std::vector<size_t>{3, 2, 4}));
  EXPECT_EQ(container.arrays.count("sh_rest"), 0u);  // none in degree 0
  for (const auto& [name, width] :
       {std::pair("key_shifts", 3), {"key_turns", 4}, {"key_scales", 3}})
    for (int key = 0; key < 3; ++key)
      for (int i = 0; i < 2 * width; ++i)
        EXPECT_EQ(container.arrays.at(name)[size_t(2 * width * key + i)],
                  model.groups.at(name)[size_t(5 * width * key + i)]);
}

TEST(ViewModel, HasNoTimesOfAStaticModel) {
  HostModel model = random_model(4, 1);
  set_static(model.shape, model.groups, 4);
  for (size_t i = 0; i < 4; ++i) model.groups["log_scales"][4 * i + 3] = 20;
  const Container container = container_of_model(model);
  EXPECT_EQ(container.header["motion"], "static");
  EXPECT_EQ(container.arrays.count("means_t"), 0u);
  EXPECT_EQ(container.arrays.at("log_scales").size(), 12u);
  EXPECT_EQ(container.arrays.at("log_scales")[3], model.groups["log_scales"][4]);
}

TEST(ViewModel, OfNoGaussiansIsValid) {
  HostModel model = random_model(0, 2);
  const Container container = container_of_model(model, ViewPrecision::half);
  EXPECT_EQ(container.header["count"], 0);
  EXPECT_TRUE(container.arrays.at("means").empty());
}

// Colours are multiples of 1/1024, and half floats have 11 bits.
TEST(ViewModel, RoundsNothingButColorsInHalfPrecision) {
  const HostModel model = random_model(50, 3);
  const Container container = container_of_model(model, ViewPrecision::half);
  for (const auto& [name, values] : model.groups) {
    const bool color = name == "sh0" || name == "sh_rest";
    for (size_t i = 0; i < values.size(); ++i)
      EXPECT_NEAR(container.arrays.at(name)[i], values[i],
                  color ? 0.5 / 1024 + std::ldexp(std::fabs(values[i]), -11) : 0)
          << name;
  }
}

// In a page of its own. Quaternions have any length, but those of the bytes have 1: their turns are
// multiples of 1/64.
TEST(ViewModel, RoundsKeysAndKeepsThoseThatAreNotFinite) {
  HostModel host = lively_model(MotionModelKind::keyframes);
  const Container whole = container_of_model(host, ViewPrecision::half);
  const auto &turns = host.groups.at("key_turns"), &shifts = host.groups.at("key_shifts");
  EXPECT_EQ(whole.header["arrays"]["key_shifts"]["type"], "uint16");
  for (size_t i = 0; i < shifts.size(); ++i)  // a 32nd of the usual size, 0.2
    ASSERT_NEAR(whole.arrays.at("key_shifts")[i], shifts[i], 7e-3);
  for (size_t row = 0; row < turns.size() / 4; ++row) {
    const size_t i = row % host.count;
    const Eigen::Map<const Eigen::Vector4f> quat(&host.groups.at("quats")[4 * i]),
        turn(&turns[4 * row]), read_quat(&whole.arrays.at("quats")[4 * i]),
        read_turn(&whole.arrays.at("key_turns")[4 * row]);
    ASSERT_NEAR(read_quat.norm(), 1, 0.01);
    const Eigen::Vector4f expected = (quat + turn) / quat.norm(), read = read_quat + read_turn;
    ASSERT_LE((read - expected).cwiseAbs().maxCoeff(), 0.02);
  }
  host.groups.at("key_shifts")[7] = INFINITY;
  const Container infinite = container_of_model(host, ViewPrecision::half);
  EXPECT_EQ(infinite.header["arrays"]["key_shifts"]["type"], "float32");
  EXPECT_EQ(infinite.arrays.at("key_shifts"), host.groups.at("key_shifts"));
}

TEST(ViewModel, NeedsPosesOfOtherModels) {
  const HostModel model = lively_model(MotionModelKind::bases);
  EXPECT_TRUE(needs_poses(model));
  EXPECT_FALSE(needs_poses(random_model(3, 0, MotionModelKind::keyframes)));
  expect_error([&] { view_model_bytes(model, nullptr, {}); }, {"poses", "bases"});
}

Eigen::Matrix3d covariance(const float* quat, const float* log_scales) {
  const Eigen::Quaterniond q =
      Eigen::Quaternionf(quat[0], quat[1], quat[2], quat[3]).cast<double>();
  EXPECT_NEAR(q.norm(), 1, 2e-3);  // multiples of 1/512; the page normalises
  const Eigen::Vector3d s(std::exp(log_scales[0]), std::exp(log_scales[1]),
                          std::exp(log_scales[2]));
  const Eigen::Matrix3d l = q.normalized().toRotationMatrix() * s.asDiagonal();
  return l * l.transpose();
}

class BakedModel : public testing::TestWithParam<MotionModelKind> {};

// Poses of the container against what the engine draws. Errors: rounding of floats, relative to
// scales of 0.1; or what files are rounded by.
void expect_poses_of_engine(const HostModel& host, ViewPrecision precision, double tolerance) {
  Queue queue = test_queue();
  const std::vector<double> times{0, 0.15, 0.4, 0.85, 1};
  const BakedPoses poses = bake_poses(queue, host, times);
  const Container c = container_of(view_model_bytes(host, &poses, {}, precision));
  EXPECT_EQ(c.header["motion"], "poses");
  EXPECT_EQ(c.header["times"], times);
  EXPECT_EQ(c.header["steps"], times.size());
  EXPECT_EQ(c.header["life"], true);
  Model model(queue, host, Purpose::rendering);
  GaussiansAt at;
  const size_t n = host.count, m = host.num_moving();
  const std::vector<float>& base_scales = c.arrays.at("log_scales");
  size_t seen = 0;
  for (size_t k = 0; k < times.size(); ++k) {
    model.motion->at(queue, model.parameters, model.time(times[k]), nullptr, at);
    const auto means = at.means.read(queue), factors = at.factors.read(queue),
               opacities = at.opacities.read(queue);
    for (size_t i = 0; i < n; ++i) {
      const double dt = double(model.time(times[k])) - double(c.arrays.at("means_t")[i]);
      const double life = std::exp(double(base_scales[4 * i + 3]));
      const double logit = c.arrays.at("logit_opacities")[i];
      const bool inside = std::fabs(dt) < double(window_sigmas(host.shape.cutoff)) * life;
      const double opacity = std::exp(-0.5 * dt * dt / life / life) / (1 + std::exp(-logit));
      EXPECT_NEAR(opacities[i], inside ? opacity : 0, 1e-5);
      if (opacities[i] == 0) continue;
      ++seen;
      const bool moves = i < m;
      const float* mean =
          moves ? &c.arrays.at("pose_means")[3 * (k * m + i)] : &c.arrays.at("means")[3 * i];
      for (size_t x = 0; x < 3; ++x) EXPECT_NEAR(mean[x], means[3 * i + x], tolerance);
      const bool keyed = moves && c.arrays.count("pose_log_scales") > 0;
      const float* scales =
          keyed ? &c.arrays.at("pose_log_scales")[3 * (k * m + i)] : &base_scales[4 * i];
      Eigen::Matrix<float, 3, 3, Eigen::RowMajor> l;
      std::copy_n(&factors[9 * i], 9, l.data());
      const Eigen::Matrix3d expected = (l * l.transpose()).cast<double>();
      std::vector<float> quat(4);
      std::copy_n(
          moves ? &c.arrays.at("pose_quats")[4 * (k * m + i)] : &c.arrays.at("quats")[4 * i], 4,
          quat.data());
      const float norm = Eigen::Map<Eigen::Vector4f>(quat.data()).norm();
      if (!moves)
        for (float& q : quat) q /= norm;  // parameters have any length
      EXPECT_LE((covariance(quat.data(), scales) - expected).cwiseAbs().maxCoeff(), tolerance);
    }
  }
  EXPECT_GT(seen, n);  // not all are outside of their windows
}

TEST_P(BakedModel, HasThePosesOfTheEngine) {
  HostModel host = lively_model(GetParam());
  expect_poses_of_engine(host, ViewPrecision::full, 1e-5);
  expect_poses_of_engine(host, ViewPrecision::half, 4e-3);  // a 64th of the usual size, 0.2
  host.moving = 40;
  Queue queue = test_queue();
  host = Model(queue, host).read(queue);  // as static Gaussians are stored
  expect_poses_of_engine(host, ViewPrecision::full, 1e-5);
}

// Linear interpolation between two times must not turn a Gaussian the long way, or through others.
TEST_P(BakedModel, HasQuaternionsOfTheSameSignOverTime) {
  Queue queue = test_queue();
  const HostModel host = lively_model(GetParam());
  std::vector<double> times;
  for (int k = 0; k <= 60; ++k) times.push_back(k / 60.0);
  const BakedPoses poses = bake_poses(queue, host, times);
  for (size_t k = 4 * host.count; k < poses.quats.size(); k += 4) {
    const Eigen::Map<const Eigen::Vector4f> now(&poses.quats[k]),
        before(&poses.quats[k - 4 * host.count]);
    EXPECT_GT(now.dot(before), 0.7f);
  }
}

INSTANTIATE_TEST_SUITE_P(Motion, BakedModel,
                         testing::Values(MotionModelKind::bases, MotionModelKind::hexplane,
                                         MotionModelKind::nodes),
                         [](const auto& info) { return std::string(name_of(info.param)); });

Eigen::Matrix3f factor_of_pose(double angle, double sheared) {
  Eigen::Matrix3d l = Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()) *
                      Eigen::Vector3d(0.3, 0.2, 0.1).asDiagonal();
  l *= Eigen::AngleAxisd(sheared, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return l.cast<float>();
}

// A model from outside may have factors of any form. Their axes follow the path as well.
TEST(PoseOfFactor, FollowsTheAxesOfAnyFactorOverTime) {
  FactorPose before{};
  for (int k = 0; k < 60; ++k) {
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> l = factor_of_pose(0.1 * k, 0.7 * (k % 5));
    const FactorPose now = pose_of_factor(l.data(), k ? &before : nullptr);
    double turned = 0;
    for (size_t i = 0; i < 4; ++i) turned += now.quat[i] * before.quat[i];
    if (k > 0) {
      EXPECT_GT(turned, 0.99) << k;  // cos of half of 0.1 rad
      for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(now.scales[i], before.scales[i], 1e-6);
    }
    const Eigen::Matrix3d r =
        Eigen::Quaterniond(now.quat[0], now.quat[1], now.quat[2], now.quat[3]).toRotationMatrix();
    const Eigen::Matrix3d again =
        r * Eigen::Vector3d(now.scales[0], now.scales[1], now.scales[2]).asDiagonal();
    EXPECT_LE(
        (again * again.transpose() - (l * l.transpose()).cast<double>()).cwiseAbs().maxCoeff(),
        1e-7);
    before = now;
  }
}

TEST(PoseOfFactor, KeepsAFlatGaussianFinite) {
  const float flat[9] = {0.2f, 0, 0, 0, 0.1f, 0, 0, 0, 0};
  const FactorPose pose = pose_of_factor(flat, nullptr);
  for (const double q : pose.quat) EXPECT_TRUE(std::isfinite(q));
  EXPECT_NEAR(pose.scales[2], 0, 1e-9);
}

// One Gaussian of size 0.1 that goes from 0 to 1, on a straight line or a detour.
BakedPoses straight_poses(size_t steps, float detour) {
  BakedPoses poses;
  poses.moving = 1;
  for (size_t k = 0; k < steps; ++k) {
    const float t = float(k) / float(steps - 1);
    poses.times.push_back(double(t));
    for (const float x : {t, detour * 4 * t * (1 - t), 0.f}) poses.means.push_back(x);
    for (const float q : {1.f, 0.f, 0.f, 0.f}) poses.quats.push_back(q);
  }
  return poses;
}

TEST(Thinned, LeavesOutTimesThatInterpolationGivesBack) {
  HostModel one;
  append_gaussian(one, {0, 0, 0}, 0.1f, some_color(0), 1);
  const BakedPoses straight = thinned(straight_poses(9, 0), one, 0.01);
  EXPECT_EQ(straight.times, (std::vector<double>{0, 1}));
  EXPECT_EQ(straight.means, (std::vector<float>{0, 0, 0, 1, 0, 0}));
  EXPECT_EQ(straight.quats.size(), 8u);
  // In the middle between every second of 9 times, the parabola of height 1 is 1/16 off its chord.
  EXPECT_EQ(thinned(straight_poses(9, 1), one, 0.62).times.size(), 9u);
  EXPECT_EQ(thinned(straight_poses(9, 1), one, 0.63).times.size(), 5u);
}

// Nearly all of a scene is still.
TEST(Thinned, KeepsTheTimesOfOneGaussianAmongManyThatAreStill) {
  HostModel many;
  const BakedPoses one = straight_poses(9, 1);
  BakedPoses poses;
  poses.moving = 50;
  poses.times = one.times;
  for (size_t i = 0; i < 50; ++i) append_gaussian(many, {0, 0, 0}, 0.1f, some_color(0), 1);
  for (size_t k = 0; k < 9; ++k)
    for (size_t i = 0; i < 50; ++i)
      for (size_t c = 0; c < 4; ++c) {
        if (c < 3) poses.means.push_back(i == 7 ? one.means[3 * k + c] : 0);
        poses.quats.push_back(one.quats[4 * k + c]);
      }
  EXPECT_EQ(thinned(poses, many, 0.62).times.size(), 9u);
  EXPECT_EQ(thinned(poses, many, 0.63).times.size(), 5u);
}

TEST(BakedPoses, TakeAsManyTimesAsFit) {
  const std::vector<double> times{0, 0.1, 0.2, 0.4, 0.7, 1};
  EXPECT_EQ(times_within(times, 10, 6 * 400), times);
  EXPECT_EQ(times_within(times, 10, 3 * 400), (std::vector<double>{0, 0.2, 1}));
  EXPECT_EQ(times_within(times, 10, 0), (std::vector<double>{0, 1}));
  EXPECT_EQ(times_within({0.5}, 10, 0), std::vector<double>{0.5});
}

}  // namespace
}  // namespace gflow
