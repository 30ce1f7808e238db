// SPDX-License-Identifier: Apache-2.0
// The engine in double, by definition: every Gaussian at every pixel, no tiles, no lists, no
// radius. The maths of one Gaussian is kernels/shared compiled for double. The per-pixel part is
// written independently: alpha from the inverse covariance (not K), and the derivative. The
// contributors of each pixel are decided first and can be fixed, so that central differences do not
// cross a threshold.
#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "optim/engine/settings.hpp"
#include "shared/camera_gradient.h"
#include "shared/transport.h"

namespace gflow::reference {

// Gaussians at both times, as the engine takes them.
struct Gaussians {
  std::vector<double> means, factors, opacities, colors;  // [N,3] [N,3,3] [N] [N,3]
  std::vector<double> means_t2, factors_t2;               // [N,3] [N,3,3]
  size_t count() const { return opacities.size(); }
};

struct Shot {
  PinholeCamera camera, camera_t2;
  double background[3] = {0, 0, 0};
  EngineSettings settings;
};

// Images or cotangents: planes [C, H, W].
struct Planes {
  std::vector<double> rgb, alpha, depth, flow;
};
// Inner product over all images.
inline double inner(const Planes& a, const Planes& v) {
  double sum = 0;
  for (const auto& [x, y] :
       {std::pair{&a.rgb, &v.rgb}, {&a.alpha, &v.alpha}, {&a.depth, &v.depth}, {&a.flow, &v.flow}})
    for (size_t i = 0; i < x->size(); ++i) sum += (*x)[i] * (*y)[i];
  return sum;
}

// A Gaussian that contributes to a pixel; `clamped`: its alpha is clamped to 0.99.
struct Contributor {
  uint32_t gaussian;
  bool clamped;
};
// The contributors of pixel i are list[first[i] .. first[i + 1]), nearest first.
struct Contributors {
  std::vector<size_t> first;
  std::vector<Contributor> list;
  std::vector<uint8_t> doubtful;  // [H, W]; 1: float32 may decide otherwise
};

inline real3 row3(const std::vector<double>& a, size_t i) {
  return {a[3 * i], a[3 * i + 1], a[3 * i + 2]};
}
inline void add_row3(std::vector<double>& a, size_t i, real3 v) {
  a[3 * i] += v.x;
  a[3 * i + 1] += v.y;
  a[3 * i + 2] += v.z;
}
inline Mat3 rows9(const std::vector<double>& a, size_t i) {
  return {row3(a, 3 * i), row3(a, 3 * i + 1), row3(a, 3 * i + 2)};
}
inline void add_rows9(std::vector<double>& a, size_t i, Mat3 m) {
  add_row3(a, 3 * i, m.r1);
  add_row3(a, 3 * i + 1, m.r2);
  add_row3(a, 3 * i + 2, m.r3);
}

// A projected Gaussian: flow = m + D (x - mean).
struct Seen {
  bool drawn, moves;
  Projection p, p2;
  Whitening w;
  Sym2 conic;  // inv(S)
  double opacity;
  real2 m;
  Mat2 d;
};

inline std::vector<Seen> see(const Shot& shot, const Gaussians& g) {
  std::vector<Seen> seen(g.count());
  for (size_t i = 0; i < g.count(); ++i) {
    Seen& s = seen[i];
    s.opacity = g.opacities[i];
    s.p = project(shot.camera, row3(g.means, i), rows9(g.factors, i));
    s.drawn = s.p.p.z >= shot.camera.near_plane && s.opacity > 0;
    if (!s.drawn) continue;
    s.w = whiten(s.p.m);
    s.conic = sym2_scale(sym2_adj(s.w.s), 1 / s.w.det);
    s.m = {0, 0};
    s.d = {0, 0, 0, 0};
    s.p2 = project(shot.camera_t2, row3(g.means_t2, i), rows9(g.factors_t2, i));
    s.moves = s.p2.p.z >= shot.camera_t2.near_plane;
    if (!s.moves) continue;
    s.m = s.p2.mean - s.p.mean;
    s.d = mat2_mul(transport(int(shot.settings.transport), s.p.m, s.w, s.p2.m), whitening_k(s.w));
  }
  return seen;
}

inline real2 pixel_centre(const Shot& shot, size_t pixel) {
  const int width = shot.camera.width;
  return {double(pixel % width) + 0.5, double(pixel / width) + 0.5};
}
// d^T inv(S) d at d = x - mean
inline double distance2(const Seen& s, real2 x) {
  const real2 d = x - s.p.mean;
  return s.conic.a * d.x * d.x + 2 * s.conic.b * d.x * d.y + s.conic.c * d.y * d.y;
}

// Decides the contributors of each pixel. A decision is doubtful if float32 rounding could change
// it: alpha within 1e-4 of 1/255, transmittance within 1e-3 of the stop threshold, raw alpha within
// 1e-5 of 0.99 (relative).
inline Contributors decide(const Shot& shot, const std::vector<Seen>& seen) {
  std::vector<uint32_t> order(seen.size());
  std::iota(order.begin(), order.end(), 0u);
  order.erase(
      std::remove_if(order.begin(), order.end(), [&](uint32_t i) { return !seen[i].drawn; }),
      order.end());
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return seen[a].p.p.z < seen[b].p.p.z; });
  std::vector<double> reach(seen.size());  // largest distance2 that can contribute
  for (uint32_t i : order) reach[i] = 2 * std::log(255 * seen[i].opacity) + 1e-3;
  const bool exclude = shot.settings.stop == StopRule::exclude;
  const size_t pixels = size_t(shot.camera.width) * shot.camera.height;
  Contributors c;
  c.first.assign(pixels + 1, 0);
  c.doubtful.assign(pixels, 0);
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    const real2 x = pixel_centre(shot, pixel);
    double T = 1;
    for (uint32_t i : order) {
      const double q = distance2(seen[i], x);
      if (q > reach[i]) continue;
      const double raw = seen[i].opacity * std::exp(-0.5 * q), alpha = std::min(raw, 0.99);
      if (std::fabs(std::log(255 * raw)) < 1e-4) c.doubtful[pixel] = 1;
      if (raw < 1 / 255.0) continue;
      const double decisive = exclude ? T * (1 - alpha) : T;
      if (std::fabs(decisive / 1e-4 - 1) < 1e-3 || std::fabs(raw / 0.99 - 1) < 1e-5)
        c.doubtful[pixel] = 1;
      if (decisive < 1e-4) break;
      c.list.push_back({i, raw > 0.99});
      T *= 1 - alpha;
    }
    c.first[pixel + 1] = c.list.size();
  }
  return c;
}

// One contributor at one pixel.
struct Layer {
  double alpha, T, weight, flow_weight;  // T: transmittance before this layer
  real2 d, flow;
};
inline std::vector<Layer> layers_at(const Shot& shot, const std::vector<Seen>& seen,
                                    const Contributors& c, size_t pixel) {
  const real2 x = pixel_centre(shot, pixel);
  std::vector<Layer> layers;
  double T = 1;
  for (size_t k = c.first[pixel]; k < c.first[pixel + 1]; ++k) {
    const Seen& s = seen[c.list[k].gaussian];
    Layer l;
    l.alpha = c.list[k].clamped ? 0.99 : s.opacity * std::exp(-0.5 * distance2(s, x));
    l.T = T;
    l.weight = l.alpha * T;
    const bool in_flow = !shot.settings.top_k || int(layers.size()) < shot.settings.top_k;
    l.flow_weight = in_flow ? l.weight : 0;
    l.d = x - s.p.mean;
    l.flow = {s.m.x + s.d.a * l.d.x + s.d.b * l.d.y, s.m.y + s.d.c * l.d.x + s.d.d * l.d.y};
    T *= 1 - l.alpha;
    layers.push_back(l);
  }
  return layers;
}

inline Planes blend(const Shot& shot, const Gaussians& g, const std::vector<Seen>& seen,
                    const Contributors& c) {
  const size_t pixels = size_t(shot.camera.width) * shot.camera.height;
  Planes out{std::vector<double>(3 * pixels), std::vector<double>(pixels),
             std::vector<double>(pixels), std::vector<double>(2 * pixels)};
  for (size_t i = 0; i < pixels; ++i) {
    double T = 1, flow_weight = 0;
    const std::vector<Layer> layers = layers_at(shot, seen, c, i);
    for (size_t k = 0; k < layers.size(); ++k) {
      const Layer& l = layers[k];
      const size_t id = c.list[c.first[i] + k].gaussian;
      for (int b = 0; b < 3; ++b) out.rgb[b * pixels + i] += l.weight * g.colors[3 * id + b];
      out.alpha[i] += l.weight;
      out.depth[i] += l.weight * seen[id].p.p.z;
      out.flow[i] += l.flow_weight * l.flow.x;
      out.flow[pixels + i] += l.flow_weight * l.flow.y;
      flow_weight += l.flow_weight;
      T *= 1 - l.alpha;
    }
    for (int b = 0; b < 3; ++b) out.rgb[b * pixels + i] += T * shot.background[b];
    if (flow_weight > 0) {
      out.flow[i] /= flow_weight;
      out.flow[pixels + i] /= flow_weight;
    }
  }
  return out;
}

// Gradients of one splat, summed over pixels.
struct SplatGradient {
  real2 mean{0, 0}, m{0, 0};  // by the mean at t1 (without the part of flow) and by m
  Sym2 s{0, 0, 0};            // by S, as a symmetric matrix
  Mat2 d{0, 0, 0, 0};         // by D
  double opacity = 0, depth = 0;
  real3 color{0, 0, 0};
};

// Back to front. `behind` is the contribution of the layers behind and the background, per unit of
// T.
inline std::vector<SplatGradient> blend_vjp(const Shot& shot, const Gaussians& g,
                                            const std::vector<Seen>& seen, const Contributors& c,
                                            const Planes& images, const Planes& v) {
  const size_t pixels = size_t(shot.camera.width) * shot.camera.height;
  std::vector<SplatGradient> out(g.count());
  for (size_t i = 0; i < pixels; ++i) {
    const std::vector<Layer> layers = layers_at(shot, seen, c, i);
    const real3 v_rgb{v.rgb[i], v.rgb[pixels + i], v.rgb[2 * pixels + i]};
    const real2 v_flow{v.flow[i], v.flow[pixels + i]};
    const real2 flow{images.flow[i], images.flow[pixels + i]};
    double W = 0;
    for (const Layer& l : layers) W += l.flow_weight;
    double behind =
        v_rgb.x * shot.background[0] + v_rgb.y * shot.background[1] + v_rgb.z * shot.background[2];
    for (size_t k = layers.size(); k-- > 0;) {
      const Layer& l = layers[k];
      const Contributor who = c.list[c.first[i] + k];
      const Seen& s = seen[who.gaussian];
      SplatGradient& o = out[who.gaussian];
      const real3 color = row3(g.colors, who.gaussian);
      double v_weight = dot(v_rgb, color) + v.alpha[i] + v.depth[i] * s.p.p.z;
      if (l.flow_weight > 0) {
        v_weight += dot(v_flow, l.flow - flow) / W;
        const real2 v_f = v_flow * (l.flow_weight / W);
        o.m = o.m + v_f;
        o.d = {o.d.a + v_f.x * l.d.x, o.d.b + v_f.x * l.d.y, o.d.c + v_f.y * l.d.x,
               o.d.d + v_f.y * l.d.y};
      }
      o.color = o.color + v_rgb * l.weight;
      o.depth += v.depth[i] * l.weight;
      const double v_alpha = l.T * (v_weight - behind);
      behind = l.alpha * v_weight + (1 - l.alpha) * behind;
      if (who.clamped) continue;
      // alpha = o exp(-q/2): dq/dmean = -2 inv(S) d, dq/dS = -(inv(S) d)(inv(S) d)^T
      o.opacity += v_alpha * l.alpha / s.opacity;
      const double v_q = -0.5 * v_alpha * l.alpha;
      const real2 n{s.conic.a * l.d.x + s.conic.b * l.d.y, s.conic.b * l.d.x + s.conic.c * l.d.y};
      o.mean = o.mean - n * (2 * v_q);
      o.s = sym2_add(o.s, sym2_scale(make_sym2(n.x * n.x, n.x * n.y, n.y * n.y), -v_q));
    }
  }
  return out;
}

// From gradients of the splats to gradients of the Gaussians at both times.
inline Gaussians see_vjp(const Shot& shot, const Gaussians& g, const std::vector<Seen>& seen,
                         const std::vector<SplatGradient>& v) {
  const size_t n = g.count();
  Gaussians out{std::vector<double>(3 * n), std::vector<double>(9 * n), std::vector<double>(n),
                std::vector<double>(3 * n), std::vector<double>(3 * n), std::vector<double>(9 * n)};
  for (size_t i = 0; i < n; ++i) {
    const Seen& s = seen[i];
    if (!s.drawn) continue;
    out.opacities[i] = v[i].opacity;
    add_row3(out.colors, i, v[i].color);
    real2 v_mean = v[i].mean;
    Mat23 v_m = covariance_vjp(s.p.m, v[i].s);
    if (s.moves) {
      const Mat2 gh = mat2_mul(v[i].d, mat2_transpose(whitening_k(s.w)));  // D = H K
      const TransportGradient t =
          transport_vjp(int(shot.settings.transport), s.p.m, s.w, s.p2.m, gh);
      const GaussianGradient v2 =
          project_vjp(shot.camera_t2, rows9(g.factors_t2, i), s.p2, v[i].m, 0, t.m2);
      add_row3(out.means_t2, i, v2.mean);
      add_rows9(out.factors_t2, i, v2.factor);
      if (!shot.settings.detach_t1) {
        // flow = mu2 - mu1 + D (x - mu1)
        v_mean =
            v_mean - v[i].m -
            make_real2(s.d.a * v[i].m.x + s.d.c * v[i].m.y, s.d.b * v[i].m.x + s.d.d * v[i].m.y);
        v_m = mat23_add(v_m, t.m1);
      }
    }
    const GaussianGradient v1 =
        project_vjp(shot.camera, rows9(g.factors, i), s.p, v_mean, v[i].depth, v_m);
    add_row3(out.means, i, v1.mean);
    add_rows9(out.factors, i, v1.factor);
  }
  return out;
}

// The whole forward pass. `fixed`: contributors of another call; otherwise they are decided here.
struct Rendering {
  std::vector<Seen> seen;
  Contributors contributors;
  Planes images;
};
inline Rendering render(const Shot& shot, const Gaussians& g, const Contributors* fixed = nullptr) {
  Rendering r;
  r.seen = see(shot, g);
  r.contributors = fixed ? *fixed : decide(shot, r.seen);
  r.images = blend(shot, g, r.seen, r.contributors);
  return r;
}
// Gradients of sum(images . v) by everything in g.
inline Gaussians render_vjp(const Shot& shot, const Gaussians& g, const Rendering& r,
                            const Planes& v) {
  return see_vjp(shot, g, r.seen, blend_vjp(shot, g, r.seen, r.contributors, r.images, v));
}

// Gradient by a camera, given those by the Gaussians that it shows: rotation, translation, log fx,
// log fy.
inline std::vector<double> camera_gradient_of(const PinholeCamera& camera,
                                              const std::vector<double>& means,
                                              const std::vector<double>& factors,
                                              const std::vector<double>& v_means,
                                              const std::vector<double>& v_factors) {
  std::vector<double> sum(CAMERA_GRADIENT_SIZE);
  for (size_t i = 0; 3 * i < means.size(); ++i) {
    const CameraGradient g = camera_gradient(camera, row3(means, i), rows9(factors, i),
                                             row3(v_means, i), rows9(v_factors, i));
    const double all[] = {g.rotation.x,    g.rotation.y,    g.rotation.z, g.translation.x,
                          g.translation.y, g.translation.z, g.log_fx,     g.log_fy};
    for (size_t k = 0; k < sum.size(); ++k) sum[k] += all[k];
  }
  return sum;
}

}  // namespace gflow::reference
