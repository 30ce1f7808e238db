// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/ignored_pixels.hpp"

#include <gtest/gtest.h>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

TEST(IgnoredPixels, TakeTheRenderedColourAndNoGradient) {
  Queue queue = test_queue();
  IgnoredPixels ignored(queue);
  const Buffer<cl_uchar> counted(queue, {255, 0, 255, 0}, "counted");
  // Planes of 4 pixels; values outside of [0, 1] are clamped.
  const Buffer<float> rgb(queue, {.1f, .2f, .3f, -1.f, .4f, .5f, .6f, 2.f, .7f, .8f, .9f, 1.f},
                          "rgb");
  Buffer<cl_uchar> truth(queue, std::vector<cl_uchar>(12, 7), "truth");
  ignored.fill_truth(queue, 4, counted, rgb, truth);
  EXPECT_EQ(truth.read(queue),
            (std::vector<cl_uchar>{7, 7, 7, 51, 128, 204, 7, 7, 7, 0, 255, 255}));
  Buffer<float> v_rgb(queue, std::vector<float>(12, 3), "v_rgb");
  ignored.clear_gradient(queue, 4, counted, v_rgb);
  EXPECT_EQ(v_rgb.read(queue), (std::vector<float>{3, 0, 3, 0, 3, 0, 3, 0, 3, 0, 3, 0}));
}

}  // namespace
}  // namespace gflow
