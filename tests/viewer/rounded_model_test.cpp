// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/rounded_model.hpp"

#include "apps/viewer/html.hpp"
#include "apps/viewer/view_model.hpp"
#include "tests/support/lively_model.hpp"

namespace gflow {
namespace {

class EveryRoundedModel : public testing::TestWithParam<MotionModelKind> {};

// Steps are an eighth of a grey level of colour and a 32nd of a Gaussian's size: 40 dB is an error
// of 2.5 levels.
TEST_P(EveryRoundedModel, LooksNearlyTheSame) {
  Queue queue = test_queue();
  const HostModel host = lively_model(GetParam());
  const HostModel rounded = rounded_model(host);
  const std::vector<RenderView> views = orbit_views(host, parse_times("0:1:4"), "-y");
  const double psnr = psnr_between(queue, rounded, host, views, {}, 0.05);
  EXPECT_GT(psnr, 40);
  EXPECT_LT(psnr, 100);  // it is rounded
  EXPECT_EQ(psnr_between(queue, host, host, views, {}, 0.05), INFINITY);
  EXPECT_EQ(rounded_model(rounded).groups.at("sh_rest"), rounded.groups.at("sh_rest"));
}

INSTANTIATE_TEST_SUITE_P(All, EveryRoundedModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& test) { return std::string(name_of(test.param)); });

TEST(RoundedModel, CompressesToTwoThirds) {
  const HostModel host = lively_model(MotionModelKind::spacetime);
  const auto bytes = [](const HostModel& model) {
    return gzipped(view_model_bytes(model, nullptr, {}, ViewPrecision::half)).size();
  };
  EXPECT_LT(3 * bytes(rounded_model(host)), 2 * bytes(host));
}

TEST(RoundedModel, KeepsWhatIsNotFinite) {
  HostModel host = lively_model(MotionModelKind::spacetime);
  host.groups["means"][0] = INFINITY;
  host.groups["log_scales"][4] = -INFINITY;
  const HostModel rounded = rounded_model(host);
  EXPECT_EQ(rounded.groups.at("means")[0], INFINITY);
  EXPECT_EQ(rounded.groups.at("log_scales")[4], -INFINITY);
}

}  // namespace
}  // namespace gflow
