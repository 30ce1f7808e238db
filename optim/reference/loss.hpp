// SPDX-License-Identifier: Apache-2.0
// The losses in double, by definition: a full 11 x 11 window at every pixel, not separable, no
// special border. Per-pixel maths is kernels/shared/loss.h compiled for double.
#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "shared/loss.h"

namespace gflow::reference {

struct ImageLossResult {
  double l1 = 0, ssim = 0, total = 0;
  std::vector<double> v_rgb;  // [3, H, W]
};

// The window's weight at offset (dx, dy).
inline double ssim_window(int dx, int dy) {
  double sum = 0;
  for (int k = -SSIM_RADIUS; k <= SSIM_RADIUS; ++k) sum += std::exp(-k * k / 4.5);
  return std::exp(-(dx * dx + dy * dy) / 4.5) / (sum * sum);
}

// Calls f(dx, dy, index of the pixel or -1 outside) over the window around (x, y).
template <class F>
void for_window(int width, int height, int x, int y, F&& f) {
  for (int dy = -SSIM_RADIUS; dy <= SSIM_RADIUS; ++dy)
    for (int dx = -SSIM_RADIUS; dx <= SSIM_RADIUS; ++dx) {
      const bool in = x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height;
      f(dx, dy, in ? (y + dy) * width + x + dx : -1);
    }
}

// rgb [3, H, W] in [0, 1], truth [H, W, 3] as 8 bits.
inline ImageLossResult image_loss(int width, int height, const std::vector<double>& rgb,
                                  const std::vector<uint8_t>& truth, double ssim_weight) {
  const int pixels = width * height;
  const double values = 3.0 * pixels;
  std::vector<double> weights;
  for_window(1, 1, 0, 0, [&](int dx, int dy, int) { weights.push_back(ssim_window(dx, dy)); });

  ImageLossResult out;
  out.v_rgb.assign(size_t(3) * pixels, 0.0);
  for (int c = 0; c < 3; ++c) {
    std::vector<double> s(pixels), d(pixels);
    for (int i = 0; i < pixels; ++i) {
      const double x = rgb[c * pixels + i], y = truth[3 * i + c] / 255.0;
      s[i] = x + y - 1;
      d[i] = x - y;
      out.l1 += std::fabs(d[i]) / values;
      const int sign = (d[i] > 0) - (d[i] < 0);
      out.v_rgb[c * pixels + i] += (1 - ssim_weight) * sign / values;
    }
    for (int i = 0; i < pixels; ++i) {
      SsimMeans means = {0, 0, 0, 0};
      size_t k = 0;
      for_window(width, height, i % width, i / width, [&](int, int, int j) {
        const double w = weights[k++], sj = j < 0 ? SSIM_OUTSIDE : s[j], dj = j < 0 ? 0 : d[j];
        means.s += w * sj;
        means.d += w * dj;
        means.ss += w * sj * sj;
        means.dd += w * dj * dj;
      });
      const SsimPixel pixel = ssim_pixel(means);
      out.ssim += pixel.value / values;
      k = 0;
      for_window(width, height, i % width, i / width, [&](int, int, int j) {
        const double w = weights[k++];
        if (j >= 0)
          out.v_rgb[c * pixels + j] -=
              ssim_weight / values * w * (pixel.mean + 2 * s[j] * pixel.ss + 2 * d[j] * pixel.dd);
      });
    }
  }
  out.total = (1 - ssim_weight) * out.l1 + ssim_weight * (1 - out.ssim);
  return out;
}

struct FlowLossResult {
  double loss = 0;
  std::vector<double> v_flow;  // [2, H, W]
};

// flow, target flow [2, H, W]; alpha, confidence [H, W]. confidence in [0, 1] includes the weight
// of the pixel's tile.
inline FlowLossResult flow_loss(const std::vector<double>& flow, const std::vector<double>& alpha,
                                const std::vector<double>& target_flow,
                                const std::vector<double>& confidence, double weight, double knee) {
  const size_t pixels = alpha.size();
  FlowLossResult out;
  out.v_flow.assign(2 * pixels, 0.0);
  for (size_t i = 0; i < pixels; ++i) {
    if (!(std::fabs(target_flow[i]) <= TARGET_FLOW_LIMIT) ||
        !(std::fabs(target_flow[pixels + i]) <= TARGET_FLOW_LIMIT))
      continue;
    const double x = flow[i] - target_flow[i], y = flow[pixels + i] - target_flow[pixels + i];
    const double w = weight / double(pixels) * confidence[i] * alpha[i];
    out.loss += w * robust_norm(x, y, knee);
    const RobustNormGradient v = robust_norm_vjp(x, y, knee, w);
    out.v_flow[i] = v.x;
    out.v_flow[pixels + i] = v.y;
  }
  return out;
}

struct DepthLossResult {
  double loss = 0;
  std::vector<double> v_depth, v_alpha;  // [H, W]
};

// depth, alpha, weights, target [H, W]; weights are the alphas by which pixels weigh, as constants.
// target: depth of the file, NaN where there is none.
inline DepthLossResult depth_loss(const std::vector<double>& depth,
                                  const std::vector<double>& alpha,
                                  const std::vector<double>& weights,
                                  const std::vector<double>& target, double weight, double knee) {
  const size_t pixels = depth.size();
  DepthLossResult out{0, std::vector<double>(pixels), std::vector<double>(pixels)};
  for (size_t i = 0; i < pixels; ++i) {
    if (!(depth[i] > 0 && alpha[i] > 0 && target[i] > 0)) continue;
    const double error = std::log(depth[i] / alpha[i] / target[i]);
    const double w = weight / double(pixels) * weights[i];
    const double root = std::sqrt(error * error + knee * knee);
    out.loss += w * (root - knee);
    out.v_depth[i] = w * error / root / depth[i];
    out.v_alpha[i] = -w * error / root / alpha[i];
  }
  return out;
}

// Scale and shift of x for y, by least squares.
struct LineFit {
  double scale = 0, shift = 0;
};
inline LineFit line_fit(const std::vector<double>& x, const std::vector<double>& y,
                        const std::vector<double>& weights) {
  double w = 0, mean_x = 0, mean_y = 0, xx = 0, xy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    w += weights[i];
    mean_x += weights[i] * x[i];
    mean_y += weights[i] * y[i];
  }
  mean_x /= w, mean_y /= w;
  for (size_t i = 0; i < x.size(); ++i) {
    xx += weights[i] * (x[i] - mean_x) * (x[i] - mean_x);
    xy += weights[i] * (x[i] - mean_x) * (y[i] - mean_y);
  }
  return {xy / xx, mean_y - xy / xx * mean_x};
}

}  // namespace gflow::reference
