// SPDX-License-Identifier: Apache-2.0
// Plain loops that share no code with the kernels, because tests check the kernels against them.
#include "optim/loss/metrics.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr int RADIUS = 5;
constexpr float SHOWN = 1.f / 255;  // smaller alpha is invisible in an 8-bit image
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

void check_values(size_t have, int width, int height) {
  if (width < 1 || height < 1 || have != size_t(3) * width * height)
    throw Error(fmt::format("image of {} x {} pixels: {} values given, expected 3 per pixel", width,
                            height, have));
}

void check_pair(const PlanarImage& a, const PlanarImage& b) {
  if (a.width != b.width || a.height != b.height)
    throw Error(fmt::format("cannot compare an image of {} x {} pixels with one of {} x {}",
                            a.width, a.height, b.width, b.height));
}

void check_mask(const std::vector<uint8_t>& mask, size_t pixels) {
  if (!mask.empty() && mask.size() != pixels)
    throw Error(fmt::format("a mask of {} pixels for {} pixels", mask.size(), pixels));
}

std::array<double, 2 * RADIUS + 1> window() {
  std::array<double, 2 * RADIUS + 1> w;
  double sum = 0;
  for (int k = -RADIUS; k <= RADIUS; ++k) sum += w[k + RADIUS] = std::exp(-k * k / (2 * 1.5 * 1.5));
  for (double& x : w) x /= sum;
  return w;
}

// Separable convolution of a plane with the window, 0 outside.
std::vector<double> blur(const std::vector<double>& plane, int width, int height) {
  const auto w = window();
  std::vector<double> across(plane.size(), 0.0), both(plane.size(), 0.0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = std::max(0, x - RADIUS); k <= std::min(width - 1, x + RADIUS); ++k)
        across[size_t(y) * width + x] += w[k - x + RADIUS] * plane[size_t(y) * width + k];
  for (int y = 0; y < height; ++y)
    for (int k = std::max(0, y - RADIUS); k <= std::min(height - 1, y + RADIUS); ++k)
      for (int x = 0; x < width; ++x)
        both[size_t(y) * width + x] += w[k - y + RADIUS] * across[size_t(k) * width + x];
  return both;
}

// Bilinear value of a plane [H, W] at (x, y), in pixels from the centre of the first pixel.
double between_pixels(const float* plane, int width, int height, double x, double y) {
  const int left = std::min(int(x), width - 1), top = std::min(int(y), height - 1);
  const int right = std::min(left + 1, width - 1), bottom = std::min(top + 1, height - 1);
  const double u = x - left, v = y - top;
  const auto at = [&](int column, int row) {
    return double(plane[size_t(row) * size_t(width) + size_t(column)]);
  };
  return (1 - v) * ((1 - u) * at(left, top) + u * at(right, top)) +
         v * ((1 - u) * at(left, bottom) + u * at(right, bottom));
}

}  // namespace

PlanarImage PlanarImage::from_bytes(int width, int height, const std::vector<uint8_t>& bytes) {
  check_values(bytes.size(), width, height);
  const size_t pixels = size_t(width) * height;
  PlanarImage image{width, height, std::vector<double>(bytes.size())};
  for (size_t i = 0; i < bytes.size(); ++i) image.values[i % 3 * pixels + i / 3] = bytes[i] / 255.0;
  return image;
}

PlanarImage PlanarImage::from_planes(int width, int height, const std::vector<float>& planes) {
  check_values(planes.size(), width, height);
  PlanarImage image{width, height, {planes.begin(), planes.end()}};
  for (double& value : image.values) value = std::clamp(value, 0.0, 1.0);
  return image;
}

double psnr(const PlanarImage& image, const PlanarImage& truth, const std::vector<uint8_t>& mask) {
  check_pair(image, truth);
  const size_t pixels = size_t(truth.width) * truth.height;
  check_mask(mask, pixels);
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < pixels; ++i) {
    if (!mask.empty() && !mask[i]) continue;
    ++count;
    for (size_t c = 0; c < 3; ++c) {
      const double d = image.values[c * pixels + i] - truth.values[c * pixels + i];
      sum += d * d;
    }
  }
  return count ? -10 * std::log10(sum / (3.0 * double(count))) : NOT_A_NUMBER;
}

PlanarImage color_matched(const PlanarImage& image, const PlanarImage& truth,
                          const std::vector<uint8_t>& mask) {
  check_pair(image, truth);
  const size_t pixels = size_t(truth.width) * truth.height;
  check_mask(mask, pixels);
  const auto color = [&](const PlanarImage& from, size_t i) {
    return Eigen::Vector3d(from.values[i], from.values[pixels + i], from.values[2 * pixels + i]);
  };
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, 3> b = Eigen::Matrix<double, 4, 3>::Zero();
  for (size_t i = 0; i < pixels; ++i) {
    if (!mask.empty() && !mask[i]) continue;
    const Eigen::Vector4d x = color(image, i).homogeneous();
    a += x * x.transpose();
    b += x * color(truth, i).transpose();
  }
  // Images of few colours do not determine the map: the solution of least length.
  const Eigen::Matrix<double, 4, 3> map = a.completeOrthogonalDecomposition().solve(b);
  PlanarImage matched{image.width, image.height, std::vector<double>(3 * pixels)};
  for (size_t i = 0; i < pixels; ++i) {
    const Eigen::Vector3d y = map.transpose() * color(image, i).homogeneous();
    for (size_t c = 0; c < 3; ++c)
      matched.values[c * pixels + i] = std::clamp(y[Eigen::Index(c)], 0.0, 1.0);
  }
  return matched;
}

std::vector<double> ssim_map(const PlanarImage& image, const PlanarImage& truth) {
  check_pair(image, truth);
  const int width = truth.width, height = truth.height;
  const size_t pixels = size_t(width) * height;
  const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  std::vector<double> map(pixels, 0.0);
  for (size_t c = 0; c < 3; ++c) {
    const auto first = std::ptrdiff_t(c * pixels), end = std::ptrdiff_t((c + 1) * pixels);
    const std::vector<double> x(image.values.begin() + first, image.values.begin() + end);
    const std::vector<double> y(truth.values.begin() + first, truth.values.begin() + end);
    std::vector<double> xx(pixels), yy(pixels), xy(pixels);
    for (size_t i = 0; i < pixels; ++i) {
      xx[i] = x[i] * x[i];
      yy[i] = y[i] * y[i];
      xy[i] = x[i] * y[i];
    }
    const auto mx = blur(x, width, height), my = blur(y, width, height);
    const auto mxx = blur(xx, width, height), myy = blur(yy, width, height);
    const auto mxy = blur(xy, width, height);
    for (size_t i = 0; i < pixels; ++i) {
      const double vx = mxx[i] - mx[i] * mx[i], vy = myy[i] - my[i] * my[i];
      const double cov = mxy[i] - mx[i] * my[i];
      map[i] += (2 * mx[i] * my[i] + c1) * (2 * cov + c2) /
                (3 * (mx[i] * mx[i] + my[i] * my[i] + c1) * (vx + vy + c2));
    }
  }
  return map;
}

double mean_of_map(const std::vector<double>& map, const std::vector<uint8_t>& mask) {
  check_mask(mask, map.size());
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < map.size(); ++i)
    if (mask.empty() || mask[i]) {
      sum += map[i];
      ++count;
    }
  return count ? sum / double(count) : NOT_A_NUMBER;
}

double ssim(const PlanarImage& image, const PlanarImage& truth, const std::vector<uint8_t>& mask) {
  return mean_of_map(ssim_map(image, truth), mask);
}

FlowMetrics flow_metrics(const std::vector<float>& flow, const std::vector<float>& truth,
                         const std::vector<uint8_t>& mask) {
  if (flow.size() != truth.size() || truth.size() % 2)
    throw Error(fmt::format("cannot compare a flow of {} values with one of {}", flow.size(),
                            truth.size()));
  const size_t pixels = truth.size() / 2;
  check_mask(mask, pixels);
  FlowMetrics metrics;
  double sum = 0;
  size_t outliers = 0;
  for (size_t i = 0; i < pixels; ++i) {
    const double u = truth[i], v = truth[pixels + i];
    if ((!mask.empty() && !mask[i]) || !std::isfinite(u) || !std::isfinite(v)) continue;
    const double error = std::hypot(flow[i] - u, flow[pixels + i] - v);
    ++metrics.pixels;
    sum += error;
    outliers += error > 3 && error > 0.05 * std::hypot(u, v);
  }
  metrics.epe = metrics.pixels ? sum / double(metrics.pixels) : NOT_A_NUMBER;
  metrics.fl_all = metrics.pixels ? double(outliers) / double(metrics.pixels) : NOT_A_NUMBER;
  return metrics;
}

double depth_error(const std::vector<float>& depth, const std::vector<float>& alpha,
                   const std::vector<float>& truth) {
  if (depth.size() != truth.size() || alpha.size() != truth.size())
    throw Error(fmt::format("cannot compare a depth of {} pixels, with alpha of {}, with one of {}",
                            depth.size(), alpha.size(), truth.size()));
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const double there = truth[i];
    if (!std::isfinite(there) || there <= 0) continue;
    const double drawn = alpha[i] < SHOWN ? 0 : double(depth[i]) / double(alpha[i]);
    sum += std::abs(drawn - there) / there;
    ++count;
  }
  return count ? sum / double(count) : NOT_A_NUMBER;
}

std::vector<float> difference(const PlanarImage& image, const PlanarImage& truth) {
  check_pair(image, truth);
  std::vector<float> planes(truth.values.size());
  for (size_t i = 0; i < planes.size(); ++i) planes[i] = float(image.values[i] - truth.values[i]);
  return planes;
}

double flicker(const std::vector<float>& error, const std::vector<float>& next_error, int width,
               int height, const std::vector<float>& flow, const std::vector<uint8_t>& mask) {
  check_values(error.size(), width, height);
  check_values(next_error.size(), width, height);
  const size_t pixels = size_t(width) * height;
  if (flow.size() != 2 * pixels)
    throw Error(fmt::format("flicker: a flow of {} values for {} pixels, expected two per pixel",
                            flow.size(), pixels));
  check_mask(mask, pixels);
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < pixels; ++i) {
    const double x = double(i % size_t(width)) + flow[i];
    const double y = double(i / size_t(width)) + flow[pixels + i];
    // Phrased so that NaN fails.
    const bool inside = x >= 0 && y >= 0 && x <= width - 1 && y <= height - 1;
    if ((!mask.empty() && !mask[i]) || !inside) continue;
    ++count;
    for (size_t c = 0; c < 3; ++c)
      sum += std::abs(between_pixels(&next_error[c * pixels], width, height, x, y) -
                      error[c * pixels + i]);
  }
  return count ? 255 * sum / (3 * double(count)) : NOT_A_NUMBER;
}

}  // namespace gflow
