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

}  // namespace gflow::reference
