// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/shown_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

uint8_t byte_of(float value) { return uint8_t(std::lround(255 * std::clamp(value, 0.f, 1.f))); }

// The smallest of 1, 2, 5 x 10^k that is at least `value`.
double round_unit(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1., 2., 5.})
    if (step * decade >= value) return step * decade;
  return 10 * decade;
}

}  // namespace

Image image_of_rgb(int width, int height, const std::vector<float>& planes) {
  Image image{width, height, 3, std::vector<uint8_t>(planes.size())};
  const size_t pixels = planes.size() / 3;
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < 3; ++c) image.pixels[3 * i + c] = byte_of(planes[c * pixels + i]);
  return image;
}

Image image_of_alpha(int width, int height, const std::vector<float>& plane) {
  Image image{width, height, 1, std::vector<uint8_t>(plane.size())};
  std::transform(plane.begin(), plane.end(), image.pixels.begin(), byte_of);
  return image;
}

std::vector<float> expected_depth(const std::vector<float>& depth,
                                  const std::vector<float>& alpha) {
  std::vector<float> expected(depth.size());
  for (size_t i = 0; i < depth.size(); ++i) expected[i] = alpha[i] > 0 ? depth[i] / alpha[i] : 0.f;
  return expected;
}

DepthCounts count_depth(const std::vector<float>& depth) {
  DepthCounts result;
  const float most = depth.empty() ? 0.f : *std::max_element(depth.begin(), depth.end());
  if (most > 0) result.unit = round_unit(double(most) / 65535);
  result.counts.reserve(depth.size());
  for (const float d : depth)
    result.counts.push_back(d > 0 ? uint16_t(std::clamp(std::round(d / result.unit), 1., 65535.))
                                  : uint16_t(0));
  return result;
}

FlowField flow_of_planes(int width, int height, const std::vector<float>& planes,
                         const std::vector<float>& alpha) {
  FlowField flow = zero_flow(width, height);
  const size_t pixels = alpha.size();
  for (size_t i = 0; i < pixels; ++i) {
    flow.valid[i] = alpha[i] >= 1.f / 255;
    if (!flow.valid[i]) continue;
    flow.uv[2 * i] = planes[i];
    flow.uv[2 * i + 1] = planes[pixels + i];
  }
  return flow;
}

Image image_of_flow(const FlowField& flow, float longest) {
  FlowImage image = color_wheel(flow, longest);
  return {image.width, image.height, 3, std::move(image.rgb)};
}

float flow_length_above(const FlowField& flow, double share) {
  std::vector<float> lengths;
  for (size_t i = 0; i < flow.valid.size(); ++i)
    if (flow.valid[i]) lengths.push_back(std::hypot(flow.uv[2 * i], flow.uv[2 * i + 1]));
  if (lengths.empty()) return 0;
  const size_t at = std::min(lengths.size() - 1, size_t((1 - share) * double(lengths.size())));
  std::nth_element(lengths.begin(), lengths.begin() + long(at), lengths.end());
  return lengths[at];
}

Image error_image(const Image& a, const Image& b, int gain) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels)
    throw Error(fmt::format("cannot compare an image of {}x{} pixels with one of {}x{}", a.width,
                            a.height, b.width, b.height));
  Image error{a.width, a.height, a.channels, std::vector<uint8_t>(a.pixels.size())};
  for (size_t i = 0; i < a.pixels.size(); ++i)
    error.pixels[i] = uint8_t(std::min(255, gain * std::abs(a.pixels[i] - b.pixels[i])));
  return error;
}

Image side_by_side(const std::vector<Image>& images) {
  Image row;
  for (const Image& image : images) {
    if (image.channels != 3 || (row.height && image.height != row.height))
      throw Error("images side by side must be RGB and of equal height");
    row.width += image.width;
    row.height = image.height;
  }
  row.channels = 3;
  row.pixels.reserve(3 * size_t(row.width) * size_t(row.height));
  for (int y = 0; y < row.height; ++y)
    for (const Image& image : images) {
      const size_t bytes = 3 * size_t(image.width);
      const auto from = image.pixels.begin() + long(bytes * size_t(y));
      row.pixels.insert(row.pixels.end(), from, from + long(bytes));
    }
  return row;
}

}  // namespace gflow
