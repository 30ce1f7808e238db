// SPDX-License-Identifier: Apache-2.0
// Metrics of results, in double on the host: PSNR, SSIM, end-point error and Fl-all of flow, depth
// error, flicker. A mask [H, W] selects the pixels that count, those not 0; an empty vector selects
// all.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gflow {

// A colour image in [0, 1], as planes: what the metrics compare.
struct PlanarImage {
  int width = 0, height = 0;
  std::vector<double> values;  // [3, H, W]

  // From 8-bit [H, W, 3].
  static PlanarImage from_bytes(int width, int height, const std::vector<uint8_t>& bytes);
  // From [3, H, W]; clamped to [0, 1], as in an image file.
  static PlanarImage from_planes(int width, int height, const std::vector<float>& planes);
};

// 10 log10(1 / mean square difference) [dB]. Infinite for equal images, NaN if no pixel counts.
// Error if sizes differ, as in all functions here.
double psnr(const PlanarImage& image, const PlanarImage& truth,
            const std::vector<uint8_t>& mask = {});

// The image after the affine map of its colours, A x + b, that is nearest to the truth over the
// mask (least squares): as if exposure and white balance of the camera were known. Clamped to [0,
// 1].
PlanarImage color_matched(const PlanarImage& image, const PlanarImage& truth,
                          const std::vector<uint8_t>& mask = {});

// SSIM per pixel [H, W], averaged over channels, as the image loss defines it (Wang et al. 2004; 11
// x 11 Gaussian window, sigma 1.5, 0 outside the image), computed from the five moments.
std::vector<double> ssim_map(const PlanarImage& image, const PlanarImage& truth);
// Mean of a map [H, W] over the mask; NaN if no pixel counts.
double mean_of_map(const std::vector<double>& map, const std::vector<uint8_t>& mask = {});
// Mean SSIM over the mask, in [-1, 1]. The window of a pixel may extend beyond the mask.
double ssim(const PlanarImage& image, const PlanarImage& truth,
            const std::vector<uint8_t>& mask = {});

struct FlowMetrics {
  double epe = 0;     // mean end-point error [px]; NaN if no pixel counts
  double fl_all = 0;  // share of pixels with an error above 3 px and above 5 %, in [0, 1] (KITTI)
  size_t pixels = 0;  // number of pixels that count
};

// Metrics of a flow [2, H, W] against its truth [2, H, W]; pixels with non-finite truth do not
// count.
FlowMetrics flow_metrics(const std::vector<float>& flow, const std::vector<float>& truth,
                         const std::vector<uint8_t>& mask = {});

// Mean of |d - d*| / d* over the pixels whose true depth d* [H, W] is finite and above 0. d is the
// expected depth of a ray, sum(w z) / sum(w): the engine's `depth` over its `alpha`, both [H, W].
// Where alpha is below 1/255, d is 0 and the error 1, so that holes do not improve the result. NaN
// if no pixel counts.
double depth_error(const std::vector<float>& depth, const std::vector<float>& alpha,
                   const std::vector<float>& truth);

// image - truth, [3, H, W] in [-1, 1].
std::vector<float> difference(const PlanarImage& image, const PlanarImage& truth);

// Temporal flicker [grey levels, 0 to 255]: how much the error of an image changes to the next
// image, along the true motion,
//
//   mean over pixels x and channels of |e'(x + f(x)) - e(x)|,   e = image - truth,
//
// with e' the error of the next image, read bilinearly, and f the true flow [2, H, W] to it. A
// pixel counts if the mask is set (it is seen at both times) and x + f(x) lies between pixel
// centres of the image. NaN if no pixel counts.
//
// This is the warping error of Lai et al. 2018 (Learning Blind Video Temporal Consistency) less
// that of the truth. What the truth changes by itself (noise, light, highlights, bilinear blur)
// does not count against an image that shows it, and a video that never changes is not optimal, as
// it is for the plain warping error. A constant error costs nothing here; PSNR measures it.
double flicker(const std::vector<float>& error, const std::vector<float>& next_error, int width,
               int height, const std::vector<float>& flow, const std::vector<uint8_t>& mask = {});

}  // namespace gflow
