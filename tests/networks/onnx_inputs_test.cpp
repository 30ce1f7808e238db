// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/onnx_inputs.hpp"

#include <gtest/gtest.h>

#include "tests/support/protobuf_message.hpp"
#include "tests/support/temporary_folder.hpp"

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

// A network with one input of `count` dimensions, all of open size.
std::string network_of_sizes(size_t count) {
  std::string shape;
  for (size_t i = 0; i < count; ++i) shape += field(1, "");
  return field(7, field(11, field(1, "x") + field(2, field(1, field(2, shape)))));
}

// Older files list weights as inputs.
TEST(OnnxInputs, WeightsAmongTheInputsAreNone) {
  const TemporaryFolder folder;
  const auto input = [](const std::string& name) { return field(11, field(1, name)); };
  const std::string path =
      folder.write("old.onnx", field(7, input("w") + field(5, field(8, "w")) + input("x")));
  const auto inputs = onnx_input_list(path);
  ASSERT_EQ(inputs.size(), 1u);
  EXPECT_EQ(inputs[0].name, "x");
}

// Each dimension takes two bytes of the file, but eight or more in memory.
TEST(OnnxInputs, HaveFewSizes) {
  const TemporaryFolder folder;
  const std::string most = folder.write("16.onnx", network_of_sizes(16));
  EXPECT_EQ(onnx_inputs(most).at("x"), std::vector<int64_t>(16, 0));
  const std::string more = folder.write("17.onnx", network_of_sizes(17));
  expect_error([&] { onnx_inputs(more); }, {more, "damaged"});
}

}  // namespace
}  // namespace gflow
