// SPDX-License-Identifier: Apache-2.0
// The small networks compute the formulas in tests/data/networks/make_networks.py.
#include "optim/networks/perceptual.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

std::string network(const std::string& name) {
  return GFLOW_SOURCE_DIR "/tests/data/networks/" + name;
}

// Whether OpenCV's dnn module is available; otherwise the error says what is missing.
bool with_dnn() {
  try {
    const Network any(network("lpips.onnx"));
    return true;
  } catch (const Error& problem) {
    EXPECT_NE(std::string(problem.what()).find("libopencv-dnn-dev"), std::string::npos)
        << problem.what();
    return false;
  }
}

class PerceptualNetwork : public testing::Test {
 protected:
  void SetUp() override {
    if (!with_dnn()) GTEST_SKIP() << "built without OpenCV's dnn module";
  }
};
using LpipsNetwork = PerceptualNetwork;
using ClipNetwork = PerceptualNetwork;

// A deterministic image that depends on the seed.
ColourPlanes some_image(int width, int height, int seed) {
  ColourPlanes image{width, height, {}};
  for (int i = 0; i < 3 * width * height; ++i)
    image.values.push_back(float((i * 29 + seed * 31 + i * i * seed) % 97) / 96);
  return image;
}

double relu(double value) { return std::max(value, 0.0); }

double expected_distance(const ColourPlanes& image, const ColourPlanes& truth) {
  const double p[2][3] = {{1, 0.5, 0}, {-0.5, 0, 1}};
  const double t[2][3] = {{0.75, 0.5, 0}, {-0.5, 0.25, 1}};
  const double l[2] = {0.5, 2};
  const size_t pixels = image.values.size() / 3;
  double sum = 0;
  for (size_t i = 0; i < pixels; ++i)
    for (size_t k = 0; k < 2; ++k) {
      double a = 0, b = 0;
      for (size_t c = 0; c < 3; ++c) {
        a += p[k][c] * (2 * double(image.values[c * pixels + i]) - 1);
        b += t[k][c] * (2 * double(truth.values[c * pixels + i]) - 1);
      }
      sum += l[k] * std::pow(relu(a) - relu(b), 2);
    }
  return sum / double(pixels);
}

TEST_F(LpipsNetwork, IsGivenImageAndTruthFromMinusOneToOne) {
  Lpips any(network("lpips.onnx"), "metrics.lpips");
  // Of open size, so that each call may have another size.
  for (const auto& [width, height] : {std::pair{6, 4}, {9, 7}, {6, 4}}) {
    const ColourPlanes a = some_image(width, height, 1), b = some_image(width, height, 2);
    EXPECT_NEAR(any.distance(a, b), expected_distance(a, b), 1e-5);
    EXPECT_NEAR(any.distance(b, a), expected_distance(b, a), 1e-5);
    EXPECT_GT(std::abs(expected_distance(a, b) - expected_distance(b, a)), 0.01);
  }
}

TEST_F(LpipsNetwork, SaysWhichSizeItTakes) {
  Lpips fixed(network("lpips_6x4.onnx"), "metrics.lpips");
  const ColourPlanes a = some_image(6, 4, 1), b = some_image(6, 4, 2);
  EXPECT_NEAR(fixed.distance(a, b), expected_distance(a, b), 1e-5);
  EXPECT_NO_THROW(fixed.require_size(6, 4));
  expect_error([&] { fixed.require_size(6, 5); },
               {"metrics.lpips", "lpips_6x4.onnx", "6x4", "6x5", "dynamic height and width"});
}

TEST_F(LpipsNetwork, RefusesWhatIsNone) {
  expect_error([] { Lpips("no/such.onnx", "metrics.lpips"); }, {"no/such.onnx"});
  expect_error([] { Lpips(network("clip.onnx"), "metrics.lpips"); },
               {"metrics.lpips", "clip.onnx", "1 inputs", "has 2"});
  expect_error(
      [] { Lpips(GFLOW_SOURCE_DIR "/tests/data/guidance/denoiser.onnx", "metrics.lpips"); },
      {"4 inputs"});
  Lpips map(network("map.onnx"), "metrics.lpips");
  expect_error([&] { map.distance(some_image(6, 4, 1), some_image(6, 4, 2)); },
               {"map.onnx", "24 values"});
  const TemporaryFolder folder;
  const std::string half =
      folder.write("half.onnx", contents(network("lpips.onnx")).substr(0, 300));
  expect_error([&] { Lpips(half, "metrics.lpips"); }, {half, "ONNX"});
}

double expected_similarity(const ColourPlanes& a, const ColourPlanes& b, int side) {
  const double weights[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, -0.25, 0.125}};
  const double bias[4] = {0.5, 0.25, 0, 1};
  const size_t pixels = size_t(side) * size_t(side);
  std::array<double, 4> embeddings[2] = {};
  for (const bool second : {false, true}) {
    const std::vector<float> input = clip_input(second ? b : a, side);
    for (size_t i = 0; i < pixels; ++i)
      for (size_t k = 0; k < 4; ++k) {
        double value = bias[k];
        for (size_t c = 0; c < 3; ++c) value += weights[k][c] * double(input[c * pixels + i]);
        embeddings[second][k] += relu(value) / double(pixels);
      }
  }
  double dot = 0, aa = 0, bb = 0;
  for (size_t k = 0; k < 4; ++k) {
    dot += embeddings[0][k] * embeddings[1][k];
    aa += embeddings[0][k] * embeddings[0][k];
    bb += embeddings[1][k] * embeddings[1][k];
  }
  return dot / std::sqrt(aa * bb);
}

TEST_F(ClipNetwork, GivesTheCosineOfTwoEmbeddings) {
  ColourPlanes a = some_image(20, 24, 1), b = some_image(20, 24, 2);
  for (size_t i = 0; i < 480; ++i) b.values[i] *= 0.25f;  // red fades: another direction
  Clip fixed(network("clip_16.onnx"), "metrics.clip"), any(network("clip.onnx"), "metrics.clip");
  EXPECT_NEAR(fixed.similarity(a, b), expected_similarity(a, b, 16), 1e-5);
  EXPECT_NEAR(any.similarity(a, b), expected_similarity(a, b, 224), 1e-5);
  EXPECT_LT(expected_similarity(a, b, 16), 0.98);
  EXPECT_NEAR(fixed.similarity(a, a), 1, 1e-6);
}

TEST_F(ClipNetwork, RefusesWhatIsNone) {
  expect_error([] { Clip(network("lpips.onnx"), "metrics.clip"); },
               {"metrics.clip", "lpips.onnx", "2 inputs", "has 1"});
  expect_error([] { Clip(network("oblong.onnx"), "metrics.clip"); }, {"16x8", "square images"});
  Clip zero(network("zero.onnx"), "metrics.clip");
  expect_error([&] { zero.similarity(some_image(9, 9, 1), some_image(9, 9, 2)); },
               {"zero.onnx", "cannot be compared"});
}

TEST_F(ClipNetwork, ThatOpenCvCannotRunIsOneSentenceOfOursAlone) {
  testing::internal::CaptureStderr();
  expect_error([] { Clip(network("unknown.onnx"), "metrics.clip"); },
               {"unknown.onnx", "OpenCV", "NoSuchOperation"});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

constexpr double mean[3] = {0.48145466, 0.4578275, 0.40821073};
constexpr double deviation[3] = {0.26862954, 0.26130258, 0.27577711};

// from PIL import Image; import numpy as np  # Pillow 9.4, in floats
// p = (np.arange(40).reshape(8, 5) * 29 % 97).astype(np.float32) / 96
// q = np.array(Image.fromarray(p, mode="F").resize((4, 6), Image.BICUBIC)).clip(0, 1)[1:5]
TEST(ClipInput, IsResizedAsPillowDoes) {
  const double pillow[16] = {0.7506443, 0.4435096, 0.5222229, 0.4975697, 0.6791970, 0.4575870,
                             0.4345182, 0.5332479, 0.7444415, 0.4100167, 0.5919767, 0.4393364,
                             0.7019992, 0.4229487, 0.5042720, 0.4750146};
  ColourPlanes image{5, 8, {}};
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < 40; ++i) image.values.push_back(float(i * 29 % 97) / 96);
  const std::vector<float> input = clip_input(image, 4);
  ASSERT_EQ(input.size(), 48u);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < 16; ++i)
      EXPECT_NEAR(double(input[16 * c + i]) * deviation[c] + mean[c], pillow[i], 1e-6) << i;
}

TEST(ClipInput, OfItsOwnSizeIsOnlyNormalised) {
  const ColourPlanes image = some_image(8, 8, 3);
  const std::vector<float> input = clip_input(image, 8);
  for (size_t i = 0; i < input.size(); ++i)
    EXPECT_NEAR(input[i], (double(image.values[i]) - mean[i / 64]) / deviation[i / 64], 1e-5);
}

TEST(ClipInput, TakesTheMiddleOfAWideImage) {
  // 12 x 4: dark, with four bright columns in the middle.
  ColourPlanes image{12, 4, {}};
  for (int i = 0; i < 3 * 48; ++i) image.values.push_back(i % 12 / 4 == 1 ? 1.f : 0.f);
  for (const float value : clip_input(image, 4)) EXPECT_GT(value, 1.5);
}

}  // namespace
}  // namespace gflow
