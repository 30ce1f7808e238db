// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/onnx.hpp"

#include <gtest/gtest.h>

#include "apps/stress/training/request.hpp"
#include "optim/guidance/sds_guidance.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

const std::string network = GFLOW_SOURCE_DIR "/tests/data/guidance/denoiser.onnx";

// The denoiser, or null in a build without OpenCV's dnn module.
std::unique_ptr<OnnxDenoiser> denoiser() {
  try {
    return std::make_unique<OnnxDenoiser>(network);
  } catch (const Error& problem) {
    EXPECT_NE(std::string(problem.what()).find("libopencv-dnn-dev"), std::string::npos)
        << problem.what();
    return nullptr;
  }
}

// make_denoiser.py defines what the network computes.
TEST(OnnxDenoiser, IsGivenImageTimestepConditionAndPose) {
  const auto net = denoiser();
  if (!net) GTEST_SKIP() << "built without OpenCV's dnn module";
  const GuidanceRequest request = some_request(1, 8, 8);
  const GuidanceView& view = request.views[0];
  const NoisyView noisy{request, view, 250, 0.5, some_values(50, 3 * 64)};
  const auto given = net->noise(noisy, true), without = net->noise(noisy, false);
  ASSERT_EQ(given.size(), 3u * 64);
  const double degree = M_PI / 180;
  const double pose[4] = {10 * degree, std::sin(30 * degree), std::cos(30 * degree), 0.5};
  const double bias[3] = {0.0625, 0, -0.0625};
  for (size_t i = 0; i < 64; ++i) {
    const auto z = [&](size_t c) { return double(noisy.z[64 * c + i]); };
    const auto condition = [&](size_t c) {
      return 2 * double(request.reference.rgb[64 * c + i]) - 1;
    };
    const double mixed[3] = {0.5 * z(0), 0.5 * z(1), 0.125 * z(0) + 0.5 * z(2)};
    const double tint[3] = {2 * 0.25 + 0.5 * pose[0], pose[1], pose[2] + 0.25 * pose[3]};
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(given[64 * c + i], mixed[c] + 0.25 * condition(c) + tint[c] + bias[c], 1e-5);
      EXPECT_NEAR(without[64 * c + i], mixed[c] + (c == 0 ? 0.5 : 0) + bias[c], 1e-5);
    }
  }
}

TEST(OnnxDenoiser, DistilsAScore) {
  if (!denoiser()) GTEST_SKIP() << "built without OpenCV's dnn module";
  SdsGuidance guidance(denoiser(), NoiseSchedule::scaled_linear(), {});
  const GuidanceRequest request = some_request(2, 8, 8);
  const auto answers = guidance.guide(request);
  EXPECT_NO_THROW(require_usable(request, answers, guidance.name()));
  EXPECT_NE(answers[0].gradient, answers[1].gradient);
  EXPECT_EQ(answers[0].gradient, guidance.guide(request)[0].gradient);
}

TEST(OnnxDenoiser, SaysWhichSizeItTakes) {
  const auto net = denoiser();
  if (!net) GTEST_SKIP() << "built without OpenCV's dnn module";
  const GuidanceRequest request = some_request(1, 10, 8);
  const NoisyView noisy{request, request.views[0], 250, 0.5, some_values(50, 3 * 80)};
  expect_error([&] { net->noise(noisy, true); }, {network, "8x8", "10x8", "guidance.size = 8"});
}

}  // namespace
}  // namespace gflow
