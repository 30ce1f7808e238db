// SPDX-License-Identifier: Apache-2.0
// The image loss (1 - l) mean |x - y| + l (1 - mean SSIM) and its gradient w.r.t. x, in three
// passes: decode both images into bordered planes; SSIM and its derivatives w.r.t. the windowed
// means; those derivatives windowed again (a symmetric window is its own transpose) and combined.
//   ssim_fwd, image_loss_bwd, l1_bwd: one work-item per LANES columns x STRIP rows of a channel.
//   The first two window the rows horizontally into private memory, then the columns vertically.
// Repeatable: every pixel and every sum is computed by one work-item in one order. On CPUs wide
// lanes and long strips are fastest, since strips recompute their neighbours' rows.
#include "shared/lane_row.h"
#include "shared/loss.h"
#include "shared/unrolled.h"
#include "shared/work.h"

#define STRIP LOSS_STRIP(LANES)

// exp(-k^2 / (2 1.5^2)) for k = -5 .. 5, divided by their sum.
constant float WINDOW[SSIM_TAPS] = {1.028380084e-03f, 7.598758135e-03f, 3.600077213e-02f,
                                    1.093606895e-01f, 2.130055377e-01f, 2.660117249e-01f,
                                    2.130055377e-01f, 1.093606895e-01f, 3.600077213e-02f,
                                    7.598758135e-03f, 1.028380084e-03f};

// byte / 255 to the last bit on every device (OpenCL allows a division to be 2.5 ulp off): equal to
// the same colour decoded elsewhere.
static inline float decode(uchar byte) {
  const float inverse = 1.0f / 255.0f;
  const float b = convert_float(byte), q = b * inverse;
  return fma(fma(-255.0f, q, b), inverse, q);
}

// s = x + y - 1 and d = x - y (shared/loss.h). One work-item per pixel, on a grid.
kernel void image_loss_prepare(const ImageLossSize size,
                               global const float* restrict rgb,    // [3, H, W] x
                               global const uchar* restrict truth,  // [H, W, 3] y, 8 bits
                               global float* restrict s,            // [3, plane]
                               global float* restrict d) {          // [3, plane]
  const int x = get_global_id(0), y = get_global_id(1);
  if (x >= size.width || y >= size.height) return;
  const int pixel = y * size.width + x;
  const int to = (y + SSIM_RADIUS) * size.stride + BORDER_X + x;
  for (int c = 0; c < 3; ++c) {
    const float a = rgb[c * size.width * size.height + pixel], b = decode(truth[3 * pixel + c]);
    s[c * size.plane + to] = a + b + SSIM_OUTSIDE;
    d[c * size.plane + to] = a - b;
  }
}

// The pixels of one work-item.
typedef struct Strip {
  int x, y, channel;  // top left pixel
  int rows;           // <= STRIP; 0: none, the launch was rounded up
} Strip;

static inline Strip strip_at(int i, ImageLossSize size) {
  const int across = (size.width + LANES - 1) / LANES, down = (size.height + STRIP - 1) / STRIP;
  Strip strip;
  strip.x = i % across * LANES;
  strip.y = i / across % down * STRIP;
  strip.channel = i / (across * down);
  strip.rows = strip.channel < 3 ? min(STRIP, size.height - strip.y) : 0;
  return strip;
}

// The element of a bordered plane that holds the strip's top left pixel.
static inline int strip_start(Strip strip, ImageLossSize size) {
  return strip.channel * size.plane + (strip.y + SSIM_RADIUS) * size.stride + BORDER_X + strip.x;
}

// Lanes right of the image become 0.
static inline lane inside(lane value, Strip strip, ImageLossSize size) {
  return LANE_SELECT(TO_LANE(0.0f), value, ROW_COLUMN < size.width - strip.x);
}

// Stores one row of the strip into the image [3, H, W], which has no border.
static inline void store_row(lane value, global float* image, int row, Strip strip,
                             ImageLossSize size) {
  global float* to = image + (strip.channel * size.height + strip.y + row) * size.width + strip.x;
  row_store(value, to, size.width - strip.x);
}

// SSIM and its derivatives w.r.t. the means at every pixel.
kernel void ssim_fwd(const ImageLossSize size,
                     global const float* restrict s,     // [3, plane]
                     global const float* restrict d,     // [3, plane]
                     global float* restrict by_mean,     // [3, plane]
                     global float* restrict by_ss,       // [3, plane]
                     global float* restrict by_dd,       // [3, plane]
                     global float* restrict ssim_sum) {  // [strips]
  const Strip strip = strip_at(get_global_id(0), size);
  if (strip.rows == 0) return;
  const int start = strip_start(strip, size);
  SsimMeans across[STRIP + 2 * SSIM_RADIUS];  // windowed horizontally
  FOR_UNROLLED(r, 0, STRIP + 2 * SSIM_RADIUS, strip.rows + 2 * SSIM_RADIUS) {
    const int from = start + (r - SSIM_RADIUS) * size.stride - SSIM_RADIUS;
    SsimMeans m = {0, 0, 0, 0};
    for (int k = 0; k < SSIM_TAPS; ++k) {
      const lane sk = ROW_LOAD(s + from + k), dk = ROW_LOAD(d + from + k);
      const lane ws = WINDOW[k] * sk, wd = WINDOW[k] * dk;
      m.s += ws;
      m.d += wd;
      m.ss = fma(ws, sk, m.ss);
      m.dd = fma(wd, dk, m.dd);
    }
    across[r] = m;
  }
  lane sum = 0;
  FOR_UNROLLED(r, 0, STRIP, strip.rows) {
    SsimMeans m = {0, 0, 0, 0};
    for (int k = 0; k < SSIM_TAPS; ++k) {
      const lane w = TO_LANE(WINDOW[k]);
      m.s = fma(w, across[r + k].s, m.s);
      m.d = fma(w, across[r + k].d, m.d);
      m.ss = fma(w, across[r + k].ss, m.ss);
      m.dd = fma(w, across[r + k].dd, m.dd);
    }
    const SsimPixel pixel = ssim_pixel(m);
    const int to = start + r * size.stride;
    ROW_STORE(inside(pixel.mean, strip, size), by_mean + to);
    ROW_STORE(inside(pixel.ss, strip, size), by_ss + to);
    ROW_STORE(inside(pixel.dd, strip, size), by_dd + to);
    sum += inside(pixel.value, strip, size);
  }
  ssim_sum[get_global_id(0)] = ROW_SUM(sum);
}

// v_rgb = l1_scale sign(d) + ssim_scale * the gradient of the sum of SSIM over all pixels.
kernel void image_loss_bwd(const ImageLossSize size, const float l1_scale, const float ssim_scale,
                           global const float* restrict s,        // [3, plane]
                           global const float* restrict d,        // [3, plane]
                           global const float* restrict by_mean,  // [3, plane]
                           global const float* restrict by_ss,    // [3, plane]
                           global const float* restrict by_dd,    // [3, plane]
                           global float* restrict v_rgb,          // [3, H, W]
                           global float* restrict l1_sum) {       // [strips] of |d|
  const Strip strip = strip_at(get_global_id(0), size);
  if (strip.rows == 0) return;
  const int start = strip_start(strip, size);
  struct {
    lane mean, ss, dd;
  } across[STRIP + 2 * SSIM_RADIUS];  // windowed horizontally
  FOR_UNROLLED(r, 0, STRIP + 2 * SSIM_RADIUS, strip.rows + 2 * SSIM_RADIUS) {
    const int from = start + (r - SSIM_RADIUS) * size.stride - SSIM_RADIUS;
    lane mean = 0, ss = 0, dd = 0;
    for (int k = 0; k < SSIM_TAPS; ++k) {
      const lane w = TO_LANE(WINDOW[k]);
      mean = fma(w, ROW_LOAD(by_mean + from + k), mean);
      ss = fma(w, ROW_LOAD(by_ss + from + k), ss);
      dd = fma(w, ROW_LOAD(by_dd + from + k), dd);
    }
    across[r].mean = mean;
    across[r].ss = ss;
    across[r].dd = dd;
  }
  lane sum = 0;
  FOR_UNROLLED(r, 0, STRIP, strip.rows) {
    lane mean = 0, ss = 0, dd = 0;
    for (int k = 0; k < SSIM_TAPS; ++k) {
      const lane w = TO_LANE(WINDOW[k]);
      mean = fma(w, across[r + k].mean, mean);
      ss = fma(w, across[r + k].ss, ss);
      dd = fma(w, across[r + k].dd, dd);
    }
    const int at = start + r * size.stride;
    const lane s_at = ROW_LOAD(s + at), d_at = ROW_LOAD(d + at);
    const lane v_ssim = mean + 2.0f * (s_at * ss + d_at * dd);
    sum += inside(fabs(d_at), strip, size);
    store_row(l1_scale * sign(d_at) + ssim_scale * v_ssim, v_rgb, r, strip, size);
  }
  l1_sum[get_global_id(0)] = ROW_SUM(sum);
}

// The same without SSIM: v_rgb = l1_scale sign(d).
kernel void l1_bwd(const ImageLossSize size, const float l1_scale,
                   global const float* restrict d,   // [3, plane]
                   global float* restrict v_rgb,     // [3, H, W]
                   global float* restrict l1_sum) {  // [strips] of |d|
  const Strip strip = strip_at(get_global_id(0), size);
  if (strip.rows == 0) return;
  const int start = strip_start(strip, size);
  lane sum = 0;
  for (int r = 0; r < strip.rows; ++r) {
    const lane d_at = ROW_LOAD(d + start + r * size.stride);
    sum += inside(fabs(d_at), strip, size);
    store_row(l1_scale * sign(d_at), v_rgb, r, strip, size);
  }
  l1_sum[get_global_id(0)] = ROW_SUM(sum);
}
