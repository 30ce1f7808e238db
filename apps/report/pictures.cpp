// SPDX-License-Identifier: Apache-2.0
#include "apps/report/pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "apps/report/html.hpp"
#include "optim/eval/shown_images.hpp"
#include "runtime/base/base64.hpp"

namespace gflow::report {
namespace {

constexpr int kQuality = 85;

Image as_rgb(const Image& image) {
  if (image.channels != 1) return over_background(image, {255, 255, 255});
  Image rgb{image.width, image.height, 3, {}};
  for (const uint8_t level : image.pixels) rgb.pixels.insert(rgb.pixels.end(), 3, level);
  return rgb;
}

}  // namespace

Picture picture_of(const Image& image, int widest) {
  Image rgb = as_rgb(image);
  if (rgb.width > widest) {
    const double scale = double(widest) / rgb.width;
    rgb = resized(rgb, widest, std::max(1, int(std::lround(rgb.height * scale))));
  }
  const std::vector<uint8_t> bytes = jpeg_of(rgb, kQuality);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return {"data:image/jpeg;base64," + base64(text), rgb.width, rgb.height};
}

Picture flow_wheel() {
  constexpr int size = 104;
  FlowField flow = zero_flow(size, size);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      const size_t i = size_t(y) * size + size_t(x);
      flow.uv[2 * i] = float(2 * x + 1 - size) / size;
      flow.uv[2 * i + 1] = float(2 * y + 1 - size) / size;
      flow.valid[i] = 255;
    }
  return picture_of(image_of_flow(flow, 1), size);
}

std::string img(const Picture& picture, const std::string& alt) {
  return fmt::format("<img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\">", picture.address,
                     picture.width, picture.height, escaped(alt));
}

}  // namespace gflow::report
