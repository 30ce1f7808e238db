// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/onnx_inputs.hpp"

#include <gtest/gtest.h>

#include "io/temporary_folder.hpp"

namespace gflow {
namespace {

const std::string denoiser = GFLOW_SOURCE_DIR "/tests/data/guidance/denoiser.onnx";
const std::string lpips = GFLOW_SOURCE_DIR "/tests/data/networks/lpips.onnx";

TEST(OnnxInputs, AreNamedWithTheirSizesAndWeightsAreNone) {
  const auto inputs = onnx_inputs(denoiser);
  ASSERT_EQ(inputs.size(), 4u);
  EXPECT_EQ(inputs.at("sample"), (std::vector<int64_t>{1, 3, 8, 8}));
  EXPECT_EQ(inputs.at("timestep"), (std::vector<int64_t>{1, 1}));
  EXPECT_EQ(inputs.at("pose"), (std::vector<int64_t>{1, 4}));
}

TEST(OnnxInputs, RefuseWhatIsNoNetwork) {
  const TemporaryFolder folder;
  expect_error([] { onnx_inputs("no/such.onnx"); }, {"no/such.onnx"});
  const std::string text = folder.write("text.onnx", "a text, not a network");
  expect_error([&] { onnx_inputs(text); }, {text, "ONNX"});
  const std::string half = folder.write("half.onnx", contents(denoiser).substr(0, 400));
  expect_error([&] { onnx_inputs(half); }, {half, "ONNX"});
  expect_error([&] { onnx_inputs(folder.write("empty.onnx", "")); }, {"ONNX"});
}

TEST(OnnxInputs, AreInTheOrderOfTheFileAndSizesLeftOpenAreZero) {
  const auto inputs = onnx_input_list(lpips);
  ASSERT_EQ(inputs.size(), 2u);
  EXPECT_EQ(inputs[0].name, "picture");
  EXPECT_EQ(inputs[1].name, "truth");
  EXPECT_EQ(inputs[0].sizes, (std::vector<int64_t>{1, 3, 0, 0}));
}

}  // namespace
}  // namespace gflow
