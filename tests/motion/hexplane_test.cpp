// SPDX-License-Identifier: Apache-2.0
// The field of hexplane: the device against plain loops in double and their differences.
#include "optim/motion/hexplane.hpp"

#include <gtest/gtest.h>

#include "optim/motion/motion_options.hpp"
#include "optim/reference/hexplane.hpp"
#include "tests/support/device.hpp"
#include "tests/support/motion_check.hpp"

namespace gflow {
namespace {

MotionShape small_shape(int levels = 2, int layers = 2, int times = 3) {
  MotionShape shape;
  shape.motion = MotionModelKind::hexplane;
  shape.duration = 2;
  shape.hexplane.levels = levels;
  shape.hexplane.layers = layers;
  shape.hexplane.times = times;
  shape.hexplane.time_spline = 1;
  shape.hexplane.resolution = 3;
  shape.hexplane.hidden = 32;
  shape.hexplane.centre = {0.1f, -0.2f, 0.f};
  shape.hexplane.half_size = {1.f, 1.5f, 0.75f};  // some Gaussians are outside
  return shape;
}

// Planes away from 0, because features are products of six.
void spread_planes(Queue& queue, MotionCheck& check) {
  std::vector<double>& planes = check.values().at("planes");
  for (double& x : planes) x = double(float(1 + x));
  check.parameters()["planes"].values.write(queue, to_float(planes));
}

struct HexplaneCase {
  int levels, layers, times;
  bool turn, resize;
  int lanes = 0;       // 0: the device's own; 1: as on a GPU
  bool spline = true;  // over the rows in time
};
class HexplaneOfSomeShapes : public testing::TestWithParam<HexplaneCase> {};
INSTANTIATE_TEST_SUITE_P(
    Motion, HexplaneOfSomeShapes,
    testing::Values(HexplaneCase{2, 2, 3, true, true}, HexplaneCase{1, 1, 1, true, true},
                    HexplaneCase{1, 3, 4, false, true}, HexplaneCase{1, 1, 2, true, false},
                    HexplaneCase{2, 2, 3, true, true, 1}, HexplaneCase{1, 2, 2, true, true, 4},
                    HexplaneCase{1, 1, 7, true, true},
                    HexplaneCase{1, 1, 6, true, true, 0, false}));

TEST_P(HexplaneOfSomeShapes, TheDeviceShowsAndDifferentiatesAsTheDoubleFormulas) {
  Queue queue = test_queue(GetParam().lanes);
  MotionShape shape = small_shape(GetParam().levels, GetParam().layers, GetParam().times);
  shape.hexplane.turn = GetParam().turn;
  shape.hexplane.resize = GetParam().resize;
  shape.hexplane.time_spline = GetParam().spline;
  MotionCheck check(queue, shape, 41, reference::forward_of(shape),
                    {{"planes", 0.2}, {"network", 0.15}});
  spread_planes(queue, check);
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0}) check.expect_same_gaussians(t, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5);  // float32
}

TEST_P(HexplaneOfSomeShapes, MovesOnlyWhatIsDynamic) {
  Queue queue = test_queue(GetParam().lanes);
  const MotionShape shape = small_shape(GetParam().levels, GetParam().layers, GetParam().times);
  for (const size_t moving : {0, 7}) {
    MotionCheck check(queue, shape, 12, reference::forward_of(shape),
                      {{"planes", 0.2}, {"network", 0.15}}, 0.5, moving);
    spread_planes(queue, check);
    check.expect_same_gaussians(0.3, {1e-5, 1e-5});
    if (moving == 0)
      check.expect_same_gradients(0.4, 0.9, 1e-5, {"planes", "network"});
    else
      check.expect_same_gradients(0.4, 0.9, 1e-5);  // float32
  }
}

TEST_P(HexplaneOfSomeShapes, TheDoubleDerivativeIsThatOfCentralDifferences) {
  MotionShape shape = small_shape(GetParam().levels, GetParam().layers, GetParam().times);
  shape.hexplane.turn = GetParam().turn;
  shape.hexplane.resize = GetParam().resize;
  shape.hexplane.time_spline = GetParam().spline;
  Random random(23);
  Named p;
  HostGroups groups;
  set_static(shape, groups, 1);  // sets the sizes of the groups
  for (const auto& [name, middle] : {std::pair{"planes", 1.0}, std::pair{"network", 0.0}})
    for (size_t k = 0; k < groups[name].size(); ++k) p[name].push_back(middle + 0.2 * random());
  for (const double t : {0.4, 1.3}) {
    const real3 mean{0.5 * random(), random(), 0.4 * random()};
    const Shift v{{random(), random(), random()},
                  {random(), random(), random(), random()},
                  {random(), random(), random()}};
    const auto sum = [&](const Named& q, real3 m) {
      const Shift d = reference::hexplane_shift(shape.hexplane, 2, q, m, t);
      return dot(d.mean, v.mean) + dot(d.quat, v.quat) + dot(d.log_scales, v.log_scales);
    };
    const auto found = reference::hexplane_vjp(shape.hexplane, 2, p, mean, t, v);
    for (const auto& [name, gradient] :
         {std::pair{"planes", &found.planes}, std::pair{"network", &found.network}}) {
      Named q = p;
      std::vector<double>& some = q[name];
      const auto expected = numeric_gradient(
          [&](const std::vector<double>& x) {
            some = x;
            return sum(q, mean);
          },
          p[name], 1e-6);
      EXPECT_LT(relative_l2(*gradient, expected), 1e-6) << name;
      EXPECT_GT(norm(expected), 0) << name;
    }
    const auto by_mean = numeric_gradient(
        [&](const std::vector<double>& x) {
          return sum(p, {x[0], x[1], x[2]});
        },
        {mean.x, mean.y, mean.z}, 1e-6);
    EXPECT_LT(relative_l2(found.mean, by_mean), 1e-6);
  }
}

TEST(Hexplane, RowsInTimeFollowTheLengthOfTheVideo) {
  for (const auto& [steps, rows] :
       {std::pair{1, 1}, {2, 1}, {20, 10}, {60, 25}, {100, 25}, {200, 50}})
    EXPECT_EQ(motion_shape(MotionModelKind::hexplane, MotionOptions(), steps).hexplane.times, rows)
        << steps;
}

TEST(Hexplane, ASizeChangesAtMostTwentyFold) {
  MotionShape shape = small_shape();
  HostGroups groups;
  set_static(shape, groups, 1);
  Named p;
  for (const char* name : {"planes", "network"})
    p[name] = std::vector<double>(groups[name].begin(), groups[name].end());
  std::fill(p["network"].end() - NETWORK_OUTPUTS, p["network"].end(), 1e6);  // the last biases
  const Shift d = reference::hexplane_shift(shape.hexplane, 2, p, {0, 0, 0}, 1);
  EXPECT_EQ(d.log_scales.x, HEXPLANE_MAX_LOG_SCALE);
  Queue queue = test_queue();
  const auto motion = make_motion(queue, shape);
  Parameters parameters(queue, 1, motion->groups(), motion->tables());
  for (const char* name : {"planes", "network"})
    parameters[name].values.write(queue, to_float(p[name]));
  for (ParameterGroup& group : parameters.groups) group.values.fill(queue, 0.f);
  parameters["quats"].values.write(queue, {1, 0, 0, 0});
  GaussiansAt at;
  const Buffer<cl_uint> all(queue, std::vector<cl_uint>{1}, "seen");
  motion->at(queue, parameters, 1, &all, at);
  for (const float x : at.factors.read(queue)) EXPECT_LT(std::fabs(x), 20.1f);
}

// Blocks and chunks in which no Gaussian, one or all are seen, and more than one of each.
TEST(Hexplane, GradientsOfManyGaussiansAreTheSumOfThoseOfFew) {
  Queue queue = test_queue();
  const MotionShape shape = small_shape();
  const size_t n = 1500;
  MotionCheck check(queue, shape, n, reference::forward_of(shape),
                    {{"planes", 0.2}, {"network", 0.15}});
  spread_planes(queue, check);
  Parameters& p = check.parameters();
  std::vector<float> v(9 * n);
  Random random(5);
  for (float& x : v) x = float(random());
  const Buffer<float> v_all(queue, v, "v");
  const auto gradients = [&](const std::vector<cl_uint>& touched) {
    p.forget_seen(queue);
    check.motion().backward(queue, p, 0.7f, true, Buffer<cl_uint>(queue, touched, "touched"), v_all,
                            v_all, v_all);
    return std::pair{p["network"].grads.read(queue), p["planes"].grads.read(queue)};
  };
  std::vector<cl_uint> all(n), odd(n), even(n);
  for (size_t i = 0; i < n; ++i) {
    all[i] = i > 400 && i != 900;
    (i % 2 ? odd : even)[i] = all[i];
  }
  const auto whole = gradients(all), again = gradients(all);
  EXPECT_EQ(whole, again);  // bitwise repeatable
  const auto first = gradients(odd), second = gradients(even);
  std::vector<double> network, planes;
  for (size_t k = 0; k < first.first.size(); ++k)
    network.push_back(double(first.first[k]) + double(second.first[k]));
  for (size_t k = 0; k < first.second.size(); ++k)
    planes.push_back(double(first.second[k]) + double(second.second[k]));
  EXPECT_LT(relative_l2(whole.first, network), 1e-5);
  EXPECT_LT(relative_l2(whole.second, planes), 1e-5);
}

TEST(Hexplane, ANewModelIsStaticAndOneWeightOfTheLastLayerMovesIt) {
  const MotionShape shape = small_shape();
  HostGroups groups;
  set_static(shape, groups, 3, 7);
  EXPECT_TRUE(is_static(shape, groups));
  Named p;
  for (const char* name : {"planes", "network"})
    p[name] = std::vector<double>(groups[name].begin(), groups[name].end());
  const auto shift = [&] {
    return reference::hexplane_shift(shape.hexplane, 2, p, {0.2, 0.1, -0.3}, 0.4).mean;
  };
  EXPECT_EQ(shift().y, 0);
  p["network"].back() = 9;  // an unused column
  EXPECT_EQ(shift().y, 0);
  p["network"][p["network"].size() - NETWORK_OUTPUTS + 1] = 2;  // the bias of y
  EXPECT_EQ(shift().y, 3);
  groups["network"][groups["network"].size() - NETWORK_OUTPUTS + 1] = 2;
  EXPECT_FALSE(is_static(shape, groups));
}

HexplaneOptions plane_weights(float plane_tv, float time_smoothness, float l1_time) {
  HexplaneOptions options;
  options.plane_tv = plane_tv;
  options.time_smoothness = time_smoothness;
  options.l1_time = l1_time;
  return options;
}

class HexplaneRule : public testing::TestWithParam<HexplaneOptions> {};
INSTANTIATE_TEST_SUITE_P(Motion, HexplaneRule,
                         testing::Values(plane_weights(0.7f, 0, 0), plane_weights(0, 0.6f, 0),
                                         plane_weights(0, 0, 0.5f),
                                         plane_weights(0.1f, 0.2f, 0.3f)));

TEST_P(HexplaneRule, GradientEqualsCentralDifferences) {
  Queue queue = test_queue();
  const MotionShape shape = small_shape(2, 1, 5);
  MotionCheck check(queue, shape, 2, reference::forward_of(shape));
  spread_planes(queue, check);
  Parameters& p = check.parameters();
  const std::vector<double>& values = check.values().at("planes");
  const std::vector<double> expected = numeric_gradient(
      [&](const std::vector<double>& x) {
        return reference::plane_cost(shape.hexplane, GetParam(), x);
      },
      values);
  MotionOptions options;
  options.hexplane = GetParam();
  // Set if nothing was seen before, added otherwise.
  check.motion().regularize(queue, p, options);
  std::vector<float> found = p["planes"].grads.read(queue);
  const std::vector<cl_uint> seen = p.more[0].rows.seen.read(queue);
  for (size_t k = 0; k < found.size(); ++k)
    if (!seen[k / size_t(shape.hexplane.channels)]) found[k] = 0;
  EXPECT_LT(relative_l2(found, expected), 1e-5);
  p.more[0].rows.seen.fill(queue, 1u);
  p["planes"].grads.fill(queue, 1.f);
  check.motion().regularize(queue, p, options);
  std::vector<double> one_more = expected;
  for (double& x : one_more) x += 1;
  EXPECT_LT(relative_l2(p["planes"].grads.read(queue), one_more), 1e-6);
}

TEST(Hexplane, ThePlanesOfAStaticModelCostNothingInTimeAndAShapeThatIsNoneIsRefused) {
  Queue queue = test_queue();
  MotionShape shape = small_shape();
  shape.hexplane.channels = 17;
  EXPECT_THROW(make_motion(queue, shape), Error);
  shape = small_shape();
  shape.hexplane.half_size[1] = 0;
  EXPECT_THROW(make_motion(queue, shape), Error);
  shape = small_shape();
  HostGroups groups;
  set_static(shape, groups, 1);
  const std::vector<double> planes(groups["planes"].begin(), groups["planes"].end());
  EXPECT_EQ(reference::plane_cost(shape.hexplane, plane_weights(0, 1, 1), planes), 0);
  EXPECT_GT(reference::plane_cost(shape.hexplane, plane_weights(1, 0, 0), planes), 0);
}

TEST(Hexplane, TheBoxHoldsAllButAFewPointsAndItsSlack) {
  std::vector<float> xyz;
  for (int i = 0; i <= 200; ++i) xyz.insert(xyz.end(), {float(i), 5.f, i ? -1.f : 1000.f});
  HexplaneShape shape;
  shape.times = 16;
  set_box(shape, xyz, 0.5f);
  EXPECT_EQ(shape.centre[0], 100);
  EXPECT_EQ(shape.half_size[0], 1.5f * 98);
  EXPECT_EQ(shape.centre[2], -1);  // without the outlier
}

TEST(Hexplane, TheBoxOfAFlatCloudIsNotAsFlat) {
  std::vector<float> xyz;
  for (int i = 0; i <= 200; ++i) xyz.insert(xyz.end(), {float(i), 5, 0.3f * float(i)});
  HexplaneShape shape;
  set_box(shape, xyz, 0);
  EXPECT_EQ(shape.half_size[0], 98);
  EXPECT_EQ(shape.half_size[1], 0.1f * 98);
  EXPECT_NEAR(shape.half_size[2], 0.3 * 98, 1e-4);
}

}  // namespace
}  // namespace gflow
