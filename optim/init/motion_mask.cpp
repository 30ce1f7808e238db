// SPDX-License-Identifier: Apache-2.0
#include "optim/init/motion_mask.hpp"

#include <algorithm>
#include <cstdlib>

namespace gflow {
namespace {

constexpr int kChange = 20;       // grey levels from the median colour that count as change
constexpr int kMargin = 12;       // [px] around the mask: SSIM's window and a little more
constexpr size_t kMedianOf = 25;  // images in the median
constexpr size_t kNoise = 8;      // fewer changed pixels than this are noise

// Median over time, per channel and pixel, of the images in which the pixel counts; of all if it
// counts in none. counted: null where all pixels do.
std::vector<uint8_t> median_image(const std::vector<std::shared_ptr<const Image>>& images,
                                  const std::vector<std::shared_ptr<const Image>>& counted) {
  std::vector<uint8_t> median(images[0]->pixels.size()), values;
  for (size_t i = 0; i < median.size(); ++i) {
    values.clear();
    for (size_t k = 0; k < images.size(); ++k)
      if (!counted[k] || counted[k]->pixels[i / 3]) values.push_back(images[k]->pixels[i]);
    if (values.empty())
      for (const auto& image : images) values.push_back(image->pixels[i]);
    std::nth_element(values.begin(), values.begin() + long(values.size() / 2), values.end());
    median[i] = values[values.size() / 2];
  }
  return median;
}

// Adds the margin to [low, low + size), rounds the length up to a multiple of 16, within [0,
// length).
void pad_side(int& low, int& size, int length) {
  int first = std::max(0, low - kMargin), last = std::min(length, low + size + kMargin);
  const int wanted = std::min(length, (last - first + 15) / 16 * 16);
  first = std::min(first, length - wanted);
  low = first;
  size = wanted;
}

}  // namespace

Rect region_around(const Image& mask) {
  const int width = mask.width, height = mask.height;
  int x0 = width, y0 = height, x1 = -1, y1 = -1;
  size_t count = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (mask.pixels[size_t(y) * size_t(width) + size_t(x)] > 0) {
        ++count;
        x0 = std::min(x0, x);
        x1 = std::max(x1, x);
        y0 = std::min(y0, y);
        y1 = std::max(y1, y);
      }
  if (count < kNoise) return {};
  Rect rect{x0, y0, x1 - x0 + 1, y1 - y0 + 1};
  pad_side(rect.x, rect.width, width);
  pad_side(rect.y, rect.height, height);
  return rect;
}

bool differs(const uint8_t* rgb, const uint8_t* usual) {
  int most = 0;
  for (size_t c = 0; c < 3; ++c) most = std::max(most, std::abs(int(rgb[c]) - int(usual[c])));
  return most >= kChange;
}

std::vector<uint8_t> changed_pixels(const Image& image, const std::vector<uint8_t>& usual) {
  const int w = image.width, h = image.height;
  std::vector<uint8_t> mask(size_t(w) * size_t(h));
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const size_t i = 3 * (size_t(y) * size_t(w) + size_t(x));
      if (!differs(&image.pixels[i], &usual[i])) continue;
      for (int v = std::max(0, y - 1); v <= std::min(h - 1, y + 1); ++v)
        for (int u = std::max(0, x - 1); u <= std::min(w - 1, x + 1); ++u)
          mask[size_t(v) * size_t(w) + size_t(u)] = 1;
    }
  return mask;
}

std::vector<uint8_t> changed_pixels(FrameStore& store, const Frame& frame,
                                    const std::vector<uint8_t>& usual) {
  std::vector<uint8_t> changed = changed_pixels(*store.rgb(frame), usual);
  if (const auto counted = store.counted(frame))
    for (size_t i = 0; i < changed.size(); ++i) changed[i] &= counted->pixels[i] & 1;
  return changed;
}

std::vector<StaticCamera> static_cameras_of(const Scene& scene, FrameStore& store) {
  std::map<int, std::vector<const Frame*>> by_camera;
  for (const Frame& frame : scene.train) by_camera[frame.camera].push_back(&frame);
  std::vector<StaticCamera> static_cameras;
  for (auto& [camera, frames] : by_camera) {
    if (frames.size() < 4) continue;
    const size_t stride = (frames.size() + kMedianOf - 1) / kMedianOf;
    std::vector<std::shared_ptr<const Image>> images, counted;
    for (size_t i = 0; i < frames.size(); i += stride) {
      images.push_back(store.rgb(*frames[i]));
      counted.push_back(store.counted(*frames[i]));
    }
    static_cameras.push_back({store.camera(*frames[0]), frames, median_image(images, counted)});
  }
  return static_cameras;
}

namespace {

// Rectangle around the pixels that differ from the background, or around the opaque ones if none
// does. Alpha alone says little if the image shows a floor.
Rect around_object(FrameStore& store, const Frame& frame, const Image& alpha) {
  const auto image = store.rgb(frame);
  const std::array<uint8_t, 3> background = store.background();
  std::vector<uint8_t> usual(image->pixels.size());
  for (size_t i = 0; i < usual.size(); ++i) usual[i] = background[i % 3];
  const Rect shown = region_around({image->width, image->height, 1, changed_pixels(*image, usual)});
  return shown.width > 0 ? shown : region_around(alpha);
}

}  // namespace

std::vector<Rect> parts_of_interest(const Scene& scene, FrameStore& store,
                                    const std::vector<StaticCamera>& static_cameras) {
  std::vector<Rect> parts;
  for (const Frame& frame : scene.train) {
    const Camera& camera = store.camera(frame);
    parts.push_back({0, 0, camera.width, camera.height});
    if (!scene.has_alpha) continue;
    if (const auto alpha = store.alpha(frame)) parts.back() = around_object(store, frame, *alpha);
  }
  if (scene.has_alpha) return parts;
  for (const StaticCamera& static_camera : static_cameras)
    for (size_t i = 0; i < static_camera.frames.size(); ++i)
      parts[size_t(static_camera.frames[i] - scene.train.data())] =
          region_around({static_camera.camera.width, static_camera.camera.height, 1,
                         changed_pixels(store, *static_camera.frames[i], static_camera.usual)});
  return parts;
}

}  // namespace gflow
