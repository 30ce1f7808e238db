// SPDX-License-Identifier: Apache-2.0
// What results are judged by, in double on the host: PSNR, SSIM, flow end point error, Fl-all.
// A mask selects pixels: [H, W], not 0 = counted; an empty vector counts all of them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gflow {

// A colour picture in [0, 1].
struct Picture {
  int width = 0, height = 0;
  std::vector<double> values;  // [3, H, W]

  // From 8-bit [H, W, 3].
  static Picture from_bytes(int width, int height, const std::vector<uint8_t>& bytes);
  // From [3, H, W]; cut to [0, 1], as writing a picture file would.
  static Picture from_planes(int width, int height, const std::vector<float>& planes);
};

// 10 log10(1 / mean square difference) [dB]. Infinite for equal pictures, NaN if no pixel counts.
// Error if sizes differ, as in all functions here.
double psnr(const Picture& picture, const Picture& truth, const std::vector<uint8_t>& mask = {});

// Mean SSIM over pixels and channels as the image loss defines it (Wang et al. 2004; 11 x 11
// Gaussian window, sigma 1.5, 0 outside the picture), in the textbook's five moments.
double ssim(const Picture& picture, const Picture& truth);

struct FlowMetrics {
  double epe = 0;     // mean end point error [px]; NaN if no pixel counts
  double fl_all = 0;  // share in [0, 1] of pixels off by more than 3 px and more than 5 % (KITTI)
  size_t pixels = 0;  // counted
};

// Of a flow [2, H, W] against its truth [2, H, W]; pixels whose truth is not finite do not count.
FlowMetrics flow_metrics(const std::vector<float>& flow, const std::vector<float>& truth,
                         const std::vector<uint8_t>& mask = {});

}  // namespace gflow
