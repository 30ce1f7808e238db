// SPDX-License-Identifier: Apache-2.0
// The losses of one pixel: SSIM from the means over its window, and the robust norm of a flow
// difference. Each function is followed by its derivative. Kernels compute a lane of pixels at once
// (LOSS_LANE), the reference one.
#ifndef GFLOW_LOSS_H
#define GFLOW_LOSS_H
#include "shared/dialect.h"
#ifdef __OPENCL_C_VERSION__
#include "shared/lane.h"
#define LOSS_LANE lane
#else
#define LOSS_LANE real
#endif

// The image loss stores images as planes with a border, so that windows need no bounds checks:
// pixel (x, y) of channel c is element c * plane + (y + SSIM_RADIUS) * stride + BORDER_X + x.
#define BORDER_X 16
typedef struct ImageLossSize {
  int width, height;  // [px]
  int stride;         // elements per row, with its borders
  int plane;          // elements per channel: (height + 2 SSIM_RADIUS) * stride
} ImageLossSize;

// SSIM (Wang, Bovik, Sheikh, Simoncelli 2004) of images x and y in [0, 1]. The window is 11 x 11,
// Gaussian with sigma 1.5, and extends over the border, where both images count as 0.
#define SSIM_RADIUS 5
#define SSIM_TAPS 11
#define SSIM_C1 ((real)1 / (real)10000)  // 0.01^2
#define SSIM_C2 ((real)9 / (real)10000)  // 0.03^2

// The planes hold s = x + y - 1 and d = x - y instead of x and y. Four means then suffice instead
// of five, since no covariance is needed, and with mid-grey at 0 the variance E[s^2] - E[s]^2 loses
// fewer digits. Outside the image s = -1 and d = 0.
#define SSIM_OUTSIDE (-1.0f)

// Gaussian-weighted means over the window of one pixel.
typedef struct SsimMeans {
  LOSS_LANE s, d, ss, dd;  // of s, d, s^2, d^2
} SsimMeans;

// The value, and its derivatives w.r.t. the means, combined for x: since ds/dx = dd/dx = 1,
//   d ssim(p) / d x(q) = w(p - q) (mean + 2 s(q) ss + 2 d(q) dd).
typedef struct SsimPixel {
  LOSS_LANE value;  // in [-1, 1]
  LOSS_LANE mean;   // d value / d (mean of s) + d value / d (mean of d)
  LOSS_LANE ss;     // d value / d (mean of s^2)
  LOSS_LANE dd;     // d value / d (mean of d^2)
} SsimPixel;

// With S = mean of x + y, D = mean of x - y and their variances P, Q:
//   ssim = luminance * structure
//   luminance = (2 mx my + C1) / (mx^2 + my^2 + C1) = ((S^2 - D^2)/2 + C1) / ((S^2 + D^2)/2 + C1)
//   structure = (2 cov_xy + C2) / (vx + vy + C2)    = ((P - Q)/2 + C2) / ((P + Q)/2 + C2)
// with 1 - luminance = D^2 / (its denominator) and 1 - structure = Q / (its denominator).
static inline SsimPixel ssim_pixel(SsimMeans m) {
  const LOSS_LANE sum = m.s + (real)1;
  const LOSS_LANE p = m.ss - m.s * m.s;
  const LOSS_LANE q = m.dd - m.d * m.d;
  const LOSS_LANE l_inv = (real)2 / (sum * sum + m.d * m.d + 2 * SSIM_C1);
  const LOSS_LANE c_inv = (real)2 / (p + q + 2 * SSIM_C2);
  const LOSS_LANE luminance = (real)1 - m.d * m.d * l_inv;
  const LOSS_LANE structure = (real)1 - q * c_inv;
  const LOSS_LANE luminance_by_sum = sum * l_inv * (m.d * m.d * l_inv);
  const LOSS_LANE luminance_by_d = -m.d * l_inv * ((real)1 + luminance);
  const LOSS_LANE structure_by_p = (real)0.5f * c_inv * (q * c_inv);
  const LOSS_LANE structure_by_q = (real)-0.5f * c_inv * ((real)1 + structure);
  SsimPixel out;
  out.value = luminance * structure;
  out.ss = luminance * structure_by_p;
  out.dd = luminance * structure_by_q;
  out.mean =
      structure * (luminance_by_sum + luminance_by_d) - (real)2 * (m.s * out.ss + m.d * out.dd);
  return out;
}

// Target flow with a larger component is an error of its file or estimator, and masked [px].
#define TARGET_FLOW_LIMIT 1e5f

// The probability that a tile counts in the flow loss of a step, then with weight 1 / share, so
// that the expected gradient is that of all tiles. motion: the tile's fastest target flow [px];
// low_motion in (0, 1]: the least share; low_motion_px > 0: the motion from which a tile always
// counts [px].
static inline real flow_share(real motion, real low_motion, real low_motion_px) {
  return fmin(fmax(motion / low_motion_px, low_motion), (real)1);
}

// rho(r) = sqrt(r^2 + knee^2) - knee with r = |(x, y)| and knee > 0: r^2 / (2 knee) near 0,
// r - knee far away. All is divided by the largest of |x|, |y|, knee, so that no square over- or
// underflows, and written without the difference: rho = r^2 / (sqrt(r^2 + knee^2) + knee).
static inline LOSS_LANE robust_norm(LOSS_LANE x, LOSS_LANE y, real knee) {
  const LOSS_LANE scale = fmax(fmax(fabs(x), fabs(y)), knee), inverse = 1 / scale;
  const LOSS_LANE a = x * inverse, b = y * inverse, k = knee * inverse;
  const LOSS_LANE square = a * a + b * b;
  return scale * (square / (sqrt(square + k * k) + k));
}

// d rho / d (x, y) = (x, y) / sqrt(r^2 + knee^2): shorter than 1, and 0 at 0.
typedef struct RobustNormGradient {
  LOSS_LANE x, y;
} RobustNormGradient;
static inline RobustNormGradient robust_norm_vjp(LOSS_LANE x, LOSS_LANE y, real knee,
                                                 LOSS_LANE v_rho) {
  const LOSS_LANE scale = fmax(fmax(fabs(x), fabs(y)), knee), inverse = 1 / scale;
  const LOSS_LANE a = x * inverse, b = y * inverse, k = knee * inverse;
  const LOSS_LANE v = v_rho / sqrt(a * a + b * b + k * k);
  RobustNormGradient out;
  out.x = a * v;
  out.y = b * v;
  return out;
}

// The depth loss of a pixel: alpha rho(log(z / target)) with the mean depth z = depth / alpha, both
// above 0. The factor alpha counts as a constant. A relative error is the same at every distance.
typedef struct DepthPixel {
  LOSS_LANE error;  // log(z / target)
  LOSS_LANE loss, v_depth, v_alpha;
} DepthPixel;
static inline DepthPixel depth_pixel(LOSS_LANE depth, LOSS_LANE alpha, LOSS_LANE target,
                                     real knee) {
  DepthPixel out;
  out.error = log(depth / (alpha * target));
  const LOSS_LANE none = out.error - out.error;
  out.loss = alpha * robust_norm(out.error, none, knee);
  const LOSS_LANE v_error = robust_norm_vjp(out.error, none, knee, none + (real)1).x;
  out.v_depth = v_error * alpha / depth;
  out.v_alpha = -v_error;
  return out;
}

// Weights of a pixel in the fit of scale and shift to a file, so that outliers do not decide
// (Cauchy). residual: relative to the mean of what is fitted. x: the file's value, with median 0 and
// median deviation 1.
static inline LOSS_LANE depth_fit_weight(LOSS_LANE residual) {
  const LOSS_LANE r = residual / (real)0.1f;
  return (real)1 / ((real)1 + r * r);
}
static inline LOSS_LANE depth_file_weight(LOSS_LANE x) {
  const LOSS_LANE r = x / (real)4;
  return (real)1 / ((real)1 + r * r);
}

#endif
