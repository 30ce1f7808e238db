// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/pixel_weights.hpp"

#include <gtest/gtest.h>

#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

TEST(PixelWeights, OfIgnoredPixelsGiveTheRenderedColourAndNoGradient) {
  Queue queue = test_queue();
  PixelWeights weights(queue);
  const Buffer<cl_uchar> counted(queue, {255, 0, 255, 0}, "counted");
  // Planes of 4 pixels; values outside of [0, 1] are clamped.
  const Buffer<float> rgb(queue, {.1f, .2f, .3f, -1.f, .4f, .5f, .6f, 2.f, .7f, .8f, .9f, 1.f},
                          "rgb");
  Buffer<cl_uchar> truth(queue, std::vector<cl_uchar>(12, 7), "truth");
  weights.fill_truth(queue, 4, counted, rgb, truth);
  EXPECT_EQ(truth.read(queue),
            (std::vector<cl_uchar>{7, 7, 7, 51, 128, 204, 7, 7, 7, 0, 255, 255}));
  std::vector<float> v(12, 3);
  v[1] = NOT_A_NUMBER;
  Buffer<float> v_rgb(queue, v, "v_rgb");
  weights.scale_gradient(queue, 4, counted, 0, 1, v_rgb);
  EXPECT_EQ(v_rgb.read(queue), (std::vector<float>{3, 0, 3, 0, 3, 0, 3, 0, 3, 0, 3, 0}));
  weights.scale_gradient(queue, 4, counted, 5, 0.5f, v_rgb);
  EXPECT_EQ(v_rgb.read(queue),
            (std::vector<float>{1.5f, 0, 1.5f, 0, 1.5f, 0, 1.5f, 0, 1.5f, 0, 1.5f, 0}));
}

}  // namespace
}  // namespace gflow
