// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/perceptual.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

// Mean and standard deviation of the images CLIP was trained on.
constexpr double kMean[3] = {0.48145466, 0.4578275, 0.40821073};
constexpr double kDeviation[3] = {0.26862954, 0.26130258, 0.27577711};

constexpr int64_t kLongest = 32768;  // [px]; longest side of an image

// Error unless the network has `count` RGB image inputs; `what` describes the expected network.
void require_image_inputs(const Network& network, size_t count, const std::string& setting,
                          const char* what) {
  if (network.inputs().size() != count)
    throw Error(fmt::format("{} = \"{}\": the network has {} inputs, but {} has {}", setting,
                            network.path(), network.inputs().size(), what, count));
  for (const NetworkInput& input : network.inputs()) {
    const auto& s = input.sizes;
    const bool fits = s.size() == 4 && (s[0] == 1 || s[0] == 0) && (s[1] == 3 || s[1] == 0) &&
                      s[2] >= 0 && s[3] >= 0 && s[2] <= kLongest && s[3] <= kLongest;
    if (!fits)
      throw Error(fmt::format(
          "{} = \"{}\": its input '{}' has shape [{}] (0: dynamic), expected [1, 3, height, width]",
          setting, network.path(), input.name, fmt::join(s, ", ")));
  }
}

std::vector<float> run(Network& network, const std::vector<NetworkValues>& values,
                       const std::string& setting) {
  try {
    return network.run(values);
  } catch (const NetworkFailed& problem) {
    const std::vector<int>& shape = values[0].shape;
    throw Error(fmt::format("{} = \"{}\": the network fails at {}x{} pixels: {}", setting,
                            network.path(), shape[3], shape[2], problem.what()));
  }
}

NetworkValues minus_one_to_one(const ColourPlanes& image) {
  NetworkValues given{{1, 3, image.height, image.width}, image.values};
  for (float& value : given.values) value = 2 * value - 1;
  return given;
}

// Keys' cubic kernel with a = -0.5.
double cubic(double x) {
  x = std::abs(x);
  if (x < 1) return (1.5 * x - 2.5) * x * x + 1;
  if (x < 2) return ((-0.5 * x + 2.5) * x - 4) * x + 2;
  return 0;
}

// Weights of the `from` samples in each of the `to` samples that cover the same length.
struct Share {
  int first = 0;
  std::vector<double> weights;
};
std::vector<Share> shares(int from, int to) {
  const double step = double(from) / to, widened = std::max(step, 1.0), reach = 2 * widened;
  std::vector<Share> all;
  for (int i = 0; i < to; ++i) {
    const double centre = (i + 0.5) * step;
    Share share;
    share.first = std::max(0, int(centre - reach + 0.5));
    const int end = std::min(from, int(centre + reach + 0.5));
    double sum = 0;
    for (int k = share.first; k < end; ++k) {
      share.weights.push_back(cubic((k + 0.5 - centre) / widened));
      sum += share.weights.back();
    }
    for (double& weight : share.weights) weight /= sum;
    all.push_back(share);
  }
  return all;
}

// Resamples a plane [height, width] to [to_height, to_width].
std::vector<double> bicubic(const float* plane, int width, int height, int to_width,
                            int to_height) {
  const std::vector<Share> across = shares(width, to_width), down = shares(height, to_height);
  std::vector<double> rows(size_t(height) * size_t(to_width), 0.0);
  for (size_t y = 0; y < size_t(height); ++y)
    for (size_t x = 0; x < size_t(to_width); ++x)
      for (size_t k = 0; k < across[x].weights.size(); ++k)
        rows[y * size_t(to_width) + x] +=
            across[x].weights[k] * double(plane[y * size_t(width) + size_t(across[x].first) + k]);
  std::vector<double> out(size_t(to_height) * size_t(to_width), 0.0);
  for (size_t y = 0; y < size_t(to_height); ++y)
    for (size_t k = 0; k < down[y].weights.size(); ++k)
      for (size_t x = 0; x < size_t(to_width); ++x)
        out[y * size_t(to_width) + x] +=
            down[y].weights[k] * rows[(size_t(down[y].first) + k) * size_t(to_width) + x];
  return out;
}

}  // namespace

Lpips::Lpips(const std::string& path, const std::string& setting)
    : network_(path), setting_(setting) {
  require_image_inputs(network_, 2, setting, "an LPIPS network");
}

void Lpips::require_size(int width, int height) const {
  for (const NetworkInput& input : network_.inputs()) {
    const int64_t h = input.sizes[2], w = input.sizes[3];
    if ((h != 0 && h != height) || (w != 0 && w != width))
      throw Error(
          fmt::format("{} = \"{}\": the network takes images of {}x{} pixels, but the views have "
                      "{}x{}: export it for that size, or with dynamic height and width",
                      setting_, network_.path(), w, h, width, height));
  }
}

double Lpips::distance(const ColourPlanes& image, const ColourPlanes& truth) {
  require_size(image.width, image.height);
  require_size(truth.width, truth.height);
  const std::vector<float> out =
      run(network_, {minus_one_to_one(image), minus_one_to_one(truth)}, setting_);
  if (out.size() != 1)
    throw Error(fmt::format("{} = \"{}\": the network returns {} values, expected one distance",
                            setting_, network_.path(), out.size()));
  if (!std::isfinite(out[0]))
    throw Error(fmt::format("{} = \"{}\": the network returns a distance that is NaN or Inf",
                            setting_, network_.path()));
  return double(out[0]);
}

Clip::Clip(const std::string& path, const std::string& setting)
    : network_(path), setting_(setting) {
  require_image_inputs(network_, 1, setting, "a CLIP image encoder");
  const int64_t height = network_.inputs()[0].sizes[2], width = network_.inputs()[0].sizes[3];
  if (height != width)
    throw Error(
        fmt::format("{} = \"{}\": the network takes images of {}x{} pixels, but a CLIP image "
                    "encoder takes square images",
                    setting, path, width, height));
  if (width != 0) side_ = int(width);
}

std::vector<float> Clip::embedding(const ColourPlanes& image) {
  return run(network_, {{{1, 3, side_, side_}, clip_input(image, side_)}}, setting_);
}

double Clip::similarity(const ColourPlanes& image, const ColourPlanes& truth) {
  const std::vector<float> a = embedding(image), b = embedding(truth);
  double dot = 0, aa = 0, bb = 0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    dot += double(a[i]) * double(b[i]);
    aa += double(a[i]) * double(a[i]);
    bb += double(b[i]) * double(b[i]);
  }
  const double cosine = dot / std::sqrt(aa * bb);
  if (a.size() != b.size() || !std::isfinite(cosine))
    throw Error(
        fmt::format("{} = \"{}\": the network returns embeddings that cannot be compared: they are "
                    "zero, contain NaN or Inf, or differ in length",
                    setting_, network_.path()));
  return cosine;
}

std::vector<float> clip_input(const ColourPlanes& image, int side) {
  const int width = image.width, height = image.height, shorter = std::min(width, height);
  const int to_width = int(int64_t(side) * width / shorter);
  const int to_height = int(int64_t(side) * height / shorter);
  const int left = int(std::lrint((to_width - side) / 2.0));  // half to even, as in torchvision
  const int top = int(std::lrint((to_height - side) / 2.0));
  std::vector<float> input;
  for (size_t c = 0; c < 3; ++c) {
    const float* plane = &image.values[c * size_t(width) * size_t(height)];
    const std::vector<double> resized = bicubic(plane, width, height, to_width, to_height);
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const double value = resized[size_t(top + y) * size_t(to_width) + size_t(left + x)];
        input.push_back(float((std::clamp(value, 0.0, 1.0) - kMean[c]) / kDeviation[c]));
      }
  }
  return input;
}

}  // namespace gflow
