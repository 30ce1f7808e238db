// SPDX-License-Identifier: Apache-2.0
// What results are judged by, in double on the host: PSNR, SSIM, flow end point error, Fl-all,
// error of depth, flicker.
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

// SSIM at each pixel [H, W], the mean of the channels, as the image loss defines it (Wang et al.
// 2004; 11 x 11 Gaussian window, sigma 1.5, 0 outside the picture), in the textbook's five moments.
std::vector<double> ssim_map(const Picture& picture, const Picture& truth);
// Mean of a map [H, W] over the mask. NaN if no pixel counts.
double mean_of_map(const std::vector<double>& map, const std::vector<uint8_t>& mask = {});
// Both: mean SSIM in [-1, 1]. The window of a pixel of the mask reaches beyond the mask.
double ssim(const Picture& picture, const Picture& truth, const std::vector<uint8_t>& mask = {});

struct FlowMetrics {
  double epe = 0;     // mean end point error [px]; NaN if no pixel counts
  double fl_all = 0;  // share in [0, 1] of pixels off by more than 3 px and more than 5 % (KITTI)
  size_t pixels = 0;  // counted
};

// Of a flow [2, H, W] against its truth [2, H, W]; pixels whose truth is not finite do not count.
FlowMetrics flow_metrics(const std::vector<float>& flow, const std::vector<float>& truth,
                         const std::vector<uint8_t>& mask = {});

// Mean of |d - d*| / d* over the pixels whose true depth d* [H, W] is finite and above 0. d is the
// depth at which a ray that hits something ends on average, sum(w z) / sum(w): the engine's `depth`
// over its `alpha`, both [H, W]. Where less than 1/255 is drawn nothing is there, d is 0 and the
// pixel's error 1, so that holes do not pay. NaN if no pixel counts.
double depth_error(const std::vector<float>& depth, const std::vector<float>& alpha,
                   const std::vector<float>& truth);

// picture - truth, [3, H, W] in [-1, 1].
std::vector<float> difference(const Picture& picture, const Picture& truth);

// Temporal flicker [grey levels, 0 to 255]: how much what is wrong with a picture changes from one
// picture to the next, seen from a point that moves with the scene,
//
//   mean over pixels x and channels of |e'(x + f(x)) - e(x)|,   e = picture - truth,
//
// e' that of the next picture, read bilinearly, f the true flow [2, H, W] to it. Pixels count where
// the mask says so (seen at both times) and x + f(x) lies between pixel centres of the picture. NaN
// if none does.
//
// It is the warping error of Lai et al. 2018 (Learning Blind Video Temporal Consistency) less that
// of the truth: what the truth changes by itself (noise, light, highlights, what bilinear reading
// loses) is not held against a picture that shows it, and, other than with the plain warping error,
// a picture that never changes is not the best one can do. A constant error costs nothing here:
// that is PSNR's.
double flicker(const std::vector<float>& error, const std::vector<float>& next_error, int width,
               int height, const std::vector<float>& flow, const std::vector<uint8_t>& mask = {});

}  // namespace gflow
