// SPDX-License-Identifier: Apache-2.0
#include "optim/model/selection.hpp"

#include "optim/eval/views.hpp"
#include "tests/support/lively_model.hpp"

namespace gflow {
namespace {

class EverySelectedModel : public testing::TestWithParam<MotionModelKind> {};

// A picture cannot tell whether invisible Gaussians were left out.
TEST_P(EverySelectedModel, LooksTheSameWithoutWhatCannotBeSeen) {
  Queue queue = test_queue();
  HostModel host = lively_model(GetParam());
  host.moving = 40;
  std::fill_n(host.groups["log_scales"].begin(), 4 * 60, -2.3f);
  for (size_t i = 0; i < 60; ++i) {
    host.groups["log_scales"][4 * i + 3] = 30;                    // always there
    host.groups["logit_opacities"][i] = i % 3 == 1 ? -9.f : 1.f;  // every third one is not
  }
  const std::vector<double> times = {0, 0.5, 1};
  Selection selection;
  selection.min_opacity = 0.01;
  const HostModel part = selected(queue, host, selection, times);
  EXPECT_EQ(part.count, 40u);
  EXPECT_EQ(part.num_moving(), 27u);
  const Camera camera = orbit_views(host, {0}, "-y")[0].camera;
  for (const double time : times) {
    const std::vector<float> whole = drawn(queue, host, time, camera),
                             left = drawn(queue, part, time, camera);
    ASSERT_EQ(whole.size(), left.size());
    for (size_t i = 0; i < whole.size(); ++i) ASSERT_NEAR(whole[i], left[i], 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(All, EverySelectedModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& test) { return std::string(name_of(test.param)); });

HostModel three_gaussians() {
  HostModel host;
  host.shape.sh_degree = 0;
  host.shape.origin = {100, 0, 0};
  append_gaussian(host, {0, 0, 0}, 0.1f, some_color(0), 1);
  append_gaussian(host, {2, 0, 0}, 0.1f, some_color(1), 1);
  append_gaussian(host, {0, 0, 0}, 0.8f, some_color(2), 1);
  for (size_t i = 0; i < 3; ++i) host.groups["log_scales"][4 * i + 3] = 30;
  return host;
}

std::vector<float> left_of(const HostModel& host, const Selection& selection,
                           const std::vector<double>& times) {
  Queue queue = test_queue();
  return selected(queue, host, selection, times).groups.at("sh0");
}

std::vector<float> colors_of(const HostModel& host, const std::vector<size_t>& rows) {
  std::vector<float> colors;
  for (const size_t i : rows)
    colors.insert(colors.end(), &host.groups.at("sh0")[3 * i], &host.groups.at("sh0")[3 * i] + 3);
  return colors;
}

TEST(Selected, LeavesOutWhatIsLargeOrOutsideTheBox) {
  const HostModel host = three_gaussians();
  Selection small;
  small.max_size = 0.5;
  EXPECT_EQ(left_of(host, small, {0}), colors_of(host, {0, 1}));
  Selection near;
  near.crop = {99, -1, -1, 101, 1, 1};  // world coordinates
  EXPECT_EQ(left_of(host, near, {0}), colors_of(host, {0, 2}));
  near.max_size = 0.5;
  EXPECT_EQ(left_of(host, near, {0}), colors_of(host, {0}));
  EXPECT_EQ(left_of(host, {}, {0}), colors_of(host, {0, 1, 2}));
}

TEST(Selected, KeepsWhatIsInsideAtOneOfTheTimes) {
  HostModel host = three_gaussians();
  for (size_t i = 0; i < 3; ++i) host.groups["means_t"][i] = 0;
  host.groups["velocities"][3] = -2;  // the second one comes to the place of the first
  Selection near;
  near.crop = {99, -1, -1, 101, 1, 1};
  EXPECT_EQ(left_of(host, near, {0, 1}), colors_of(host, {0, 1, 2}));
  EXPECT_EQ(left_of(host, near, {0}), colors_of(host, {0, 2}));
}

TEST(Selected, MayBeEmptyWhichIsAnError) {
  HostModel host = three_gaussians();
  Selection nowhere;
  nowhere.crop = {-1, -1, -1, 1, 1, 1};
  EXPECT_TRUE(left_of(host, nowhere, {0}).empty());
  host.count = 0;
  expect_error([&] { require_some_left(host, 3, "a.ply"); }, {"a.ply", "3 Gaussians", "--crop"});
}

}  // namespace
}  // namespace gflow
