// SPDX-License-Identifier: Apache-2.0
// The same input gives the same bits: images and gradients, in one engine and in a new one.
#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

class Repeat : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, Repeat, testing::Values(16, 8, 4, 1),
                         testing::PrintToStringParamName());

TEST_P(Repeat, ImagesAndGradientsHaveTheSameBitsInEveryRun) {
  SceneSpec spec;
  spec.n = 3000;
  spec.width = GetParam() > 1 ? 150 : 60;
  spec.height = GetParam() > 1 ? 90 : 40;
  spec.cover = 40;
  PosedScene s = random_scene(spec);
  for (size_t i = 0; i < 200; ++i)  // copies of others: ties in depth
    for (auto& [name, values] : s.p) {
      const size_t width = values.size() / spec.n;
      std::copy_n(values.begin() + i * width, width, values.begin() + (2000 + i) * width);
    }
  const reference::Planes v = random_cotangents(s, 1);
  FloatArrays images, gradients;
  for (int run = 0; run < 2; ++run) {
    Queue queue = test_queue(GetParam());
    DeviceScene device(queue, s);
    for (int again = 0; again < 3; ++again) {
      const FloatArrays i = device.forward(), g = device.backward(v);
      if (images.empty()) images = i, gradients = g;
      EXPECT_TRUE(i == images);
      EXPECT_TRUE(g == gradients);
    }
  }
}

}  // namespace
}  // namespace gflow
