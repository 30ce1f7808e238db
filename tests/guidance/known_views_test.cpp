// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/known_views.hpp"

#include "apps/stress/training/request.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// eval_0 has steps 0 to 2, eval_1 none; a single image applies to any view.
class KnownViewsTest : public testing::Test {
 protected:
  KnownViewsTest() {
    for (int k = 0; k < 3; ++k) grey("eval_0/" + std::to_string(k) + ".png", uint8_t(50 * k));
    grey("any.png", 255);
    FlowField flow = zero_flow(4, 4);
    flow.uv[2] = 3;
    write_flo(folder_.file("flow/eval_0/0002.flo"), flow);
  }
  void grey(const std::string& name, uint8_t level) {
    write_png(folder_.file(name), {4, 4, 3, std::vector<uint8_t>(48, level)});
  }
  TemporaryFolder folder_;
};

TEST_F(KnownViewsTest, AViewOfAKnownCameraHasItsImageOfThatTime) {
  const KnownViews views(folder_.path());
  const GuidanceRequest request = some_request(2, 4, 4);  // frame 2
  const auto own = views.images(request, request.views[0], true);
  ASSERT_EQ(own.size(), 1u);
  EXPECT_EQ(own[0], std::vector<float>(48, float(100) / 255));
  EXPECT_EQ(views.images(request, request.views[0], false).size(), 2u);
  EXPECT_EQ(views.images(request, request.views[1], true).size(), 2u);
}

TEST_F(KnownViewsTest, ImagesTakeTheSizeOfTheViewAndRefuseAnotherShape) {
  const KnownViews views(folder_.path());
  const GuidanceRequest large = some_request(1, 8, 8), wide = some_request(1, 8, 4);
  EXPECT_EQ(views.images(large, large.views[0], true)[0].size(), 3u * 64);
  expect_error([&] { views.images(wide, wide.views[0], true); },
               {"4x4", "8x4", "same aspect ratio"});
}

TEST_F(KnownViewsTest, TransparencyShowsTheBackground) {
  write_png(folder_.file("eval_0/2.png"), {1, 1, 4, {200, 100, 0, 51}});
  const KnownViews views(folder_.path());
  GuidanceRequest request = some_request(1, 1, 1);
  request.background = {0, 1, 0.5f};
  const auto image = views.images(request, request.views[0], true)[0];
  EXPECT_NEAR(image[0], 0.2 * 200 / 255, 1e-6);
  EXPECT_NEAR(image[1], 0.2 * 100 / 255 + 0.8, 1e-6);
  EXPECT_NEAR(image[2], 0.4, 1e-6);
}

TEST_F(KnownViewsTest, AFlowIsGivenWhereThereIsOne) {
  const KnownViews views(folder_.path());
  GuidanceRequest request = some_request(2, 4, 4, true);
  const auto flow = views.flow(request, request.views[0]);
  ASSERT_TRUE(flow);
  EXPECT_EQ(flow->flow.uv[2], 3);
  EXPECT_FALSE(views.flow(request, request.views[1]));
  request.next_frame = 4;  // skips a step, so the flow of the file leads elsewhere
  EXPECT_FALSE(views.flow(request, request.views[0]));
  request.frame = 1, request.next_frame = 2;
  EXPECT_FALSE(views.flow(request, request.views[0]));
}

TEST_F(KnownViewsTest, AMissingTimeStepIsNamed) {
  const KnownViews views(folder_.path());
  GuidanceRequest request = some_request(1, 4, 4);
  request.frame = 3;
  expect_error([&] { views.images(request, request.views[0], true); },
               {"time step 3", "camera eval_0"});
}

}  // namespace
}  // namespace gflow
