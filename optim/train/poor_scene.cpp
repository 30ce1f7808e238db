// SPDX-License-Identifier: Apache-2.0
#include "optim/train/poor_scene.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

constexpr size_t kGlances = 8;   // images, evenly over the scene
constexpr int kGlanceSide = 64;  // of their longer side [px]; averages noise away
constexpr int kOneColor = 10;    // of 255 within which a colour is one; a dark wall spans more
constexpr int kLeastTimes = 4;

bool is_of_one_color(const Image& image) {
  const double scale = std::min(1.0, kGlanceSide / double(std::max(image.width, image.height)));
  const auto side = [&](int pixels) { return std::max(1, int(scale * pixels)); };
  const Image small = resized(image, side(image.width), side(image.height));
  for (size_t c = 0; c < 3; ++c) {
    int least = 255, most = 0;
    for (size_t i = c; i < small.pixels.size(); i += 3) {
      least = std::min(least, int(small.pixels[i]));
      most = std::max(most, int(small.pixels[i]));
    }
    if (most - least > kOneColor) return false;
  }
  return true;
}

bool are_of_one_color(const std::vector<Frame>& frames, FrameStore& store) {
  const size_t count = std::min(kGlances, frames.size());
  for (size_t i = 0; i < count; ++i) try {
      const Frame& frame = frames[(2 * i + 1) * frames.size() / (2 * count)];
      if (!is_of_one_color(*store.rgb(frame))) return false;
    } catch (const Error&) {  // reported when it is trained on
      return false;
    }
  return true;
}

}  // namespace

void warn_of_poor_scene(const Scene& scene, FrameStore& store) {
  const std::string& place = scene.folder.empty() ? scene.name : scene.folder;
  const bool one_at_a_time = scene.train.size() < 2 * size_t(scene.steps);
  if (one_at_a_time && scene.steps < kLeastTimes)
    warn(
        fmt::format("the images of {} show only {} distinct time{}: too few to learn or check "
                    "motion, whatever the PSNR",
                    place, scene.steps, scene.steps == 1 ? "" : "s"));
  if (!scene.has_alpha && are_of_one_color(scene.train, store))
    warn(
        fmt::format("the images of {} are all of one colour: neither shape nor motion can be "
                    "learned, whatever the PSNR",
                    place));
}

}  // namespace gflow
