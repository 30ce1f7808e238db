// SPDX-License-Identifier: Apache-2.0
// Parameters of Gaussians in double: poses (quaternion and scales at each time), and the native4d
// model with spherical harmonics; each with its derivative. Arrays by name, as in files and
// parameter groups.
#pragma once
#include <map>
#include <string>

#include "optim/reference/render.hpp"
#include "shared/motion/native4d.h"
#include "shared/sh.h"

namespace gflow::reference {

using Named = std::map<std::string, std::vector<double>>;

inline real4 row4(const std::vector<double>& a, size_t i) {
  return {a[4 * i], a[4 * i + 1], a[4 * i + 2], a[4 * i + 3]};
}
inline void add_row4(std::vector<double>& a, size_t i, real4 v) {
  a[4 * i] += v.x;
  a[4 * i + 1] += v.y;
  a[4 * i + 2] += v.z;
  a[4 * i + 3] += v.w;
}
// Zeros in the shape of p.
inline Named zeros_like(const Named& p) {
  Named z;
  for (const auto& [name, values] : p) z[name].assign(values.size(), 0.0);
  return z;
}

// means, quats, scales, opacities, colors, means_t2, quats_t2, scales_t2
inline Gaussians posed(const Named& p) {
  const size_t n = p.at("opacities").size();
  Gaussians g{p.at("means"),  std::vector<double>(9 * n), p.at("opacities"),
              p.at("colors"), p.at("means_t2"),           std::vector<double>(9 * n)};
  for (size_t i = 0; i < n; ++i) {
    add_rows9(g.factors, i, factor_of(row4(p.at("quats"), i), row3(p.at("scales"), i)));
    add_rows9(g.factors_t2, i, factor_of(row4(p.at("quats_t2"), i), row3(p.at("scales_t2"), i)));
  }
  return g;
}
inline Named posed_vjp(const Named& p, const Gaussians& v) {
  Named g = zeros_like(p);
  g["means"] = v.means;
  g["opacities"] = v.opacities;
  g["colors"] = v.colors;
  g["means_t2"] = v.means_t2;
  for (size_t i = 0; i < v.count(); ++i)
    for (const std::string end : {"", "_t2"}) {
      const FactorGradient f =
          factor_of_vjp(row4(p.at("quats" + end), i), row3(p.at("scales" + end), i),
                        rows9(end.empty() ? v.factors : v.factors_t2, i));
      add_row4(g["quats" + end], i, f.quat);
      add_row3(g["scales" + end], i, f.scales);
    }
  return g;
}

// Groups of optim/motion/native4d.hpp, and of optim/motion/color.hpp.
inline Native4d native4d_row(const Named& p, size_t i) {
  Native4d g;
  g.mean = row3(p.at("means"), i);
  g.mean_t = p.at("means_t")[i];
  g.quat = row4(p.at("quats"), i);
  g.quat_r = row4(p.at("quats_r"), i);
  g.log_scales = row4(p.at("log_scales"), i);
  g.logit_opacity = p.at("logit_opacities")[i];
  return g;
}
inline void add_native4d_row(Named& p, size_t i, const Native4d& v) {
  add_row3(p["means"], i, v.mean);
  p["means_t"][i] += v.mean_t;
  add_row4(p["quats"], i, v.quat);
  add_row4(p["quats_r"], i, v.quat_r);
  add_row4(p["log_scales"], i, v.log_scales);
  p["logit_opacities"][i] += v.logit_opacity;
}

inline real3 camera_centre(const PinholeCamera& c) {
  const float *r = c.rotation, *t = c.translation;
  return -make_real3(double(r[0]) * t[0] + double(r[3]) * t[1] + double(r[6]) * t[2],
                     double(r[1]) * t[0] + double(r[4]) * t[1] + double(r[7]) * t[2],
                     double(r[2]) * t[0] + double(r[5]) * t[1] + double(r[8]) * t[2]);
}

// 1/2 + sum_k sh_k Y_k(d) before the clamp at 0; the coefficients are sh0 [N,3], sh_rest [N,K,3].
inline real3 sh_sum(const Named& p, size_t i, int degree, real3 d) {
  const size_t stride = p.at("sh_rest").size() / (p.at("sh0").size());
  const ShBasis b = sh_basis(degree, d);
  real3 c = make_real3(.5, .5, .5) + row3(p.at("sh0"), i) * b.y[0];
  for (int k = 1; k < (degree + 1) * (degree + 1); ++k)
    c = c + row3(p.at("sh_rest"), i * stride + k - 1) * b.y[k];
  return c;
}
inline real3 sh_color(const Named& p, size_t i, int degree, real3 mean, real3 camera) {
  const real3 c = sh_sum(p, i, degree, direction_to(mean, camera).d);
  return make_real3(std::max(c.x, 0.), std::max(c.y, 0.), std::max(c.z, 0.));
}
// Adds to sh0 and sh_rest in `g`; returns the gradient by the mean.
inline real3 sh_color_vjp(const Named& p, size_t i, int degree, real3 mean, real3 camera, real3 v,
                          Named& g) {
  const size_t stride = p.at("sh_rest").size() / (p.at("sh0").size());
  const Direction o = direction_to(mean, camera);
  const real3 c = sh_sum(p, i, degree, o.d);
  v = make_real3(c.x > 0 ? v.x : 0, c.y > 0 ? v.y : 0, c.z > 0 ? v.z : 0);
  const ShBasis b = sh_basis(degree, o.d);
  ShBasis v_b{};
  add_row3(g["sh0"], i, v * b.y[0]);
  for (int k = 1; k < (degree + 1) * (degree + 1); ++k) {
    add_row3(g["sh_rest"], i * stride + k - 1, v * b.y[k]);
    v_b.y[k] = dot(row3(p.at("sh_rest"), i * stride + k - 1), v);
  }
  return direction_to_vjp(o, sh_basis_vjp(degree, o.d, v_b));
}

// A native4d field with SH colour seen at t1 by `camera`, and its motion to t2.
struct Cut {
  double t1, t2;
  int degree;
  PinholeCamera camera;
};
inline Gaussians native4d(const Named& p, const Cut& cut) {
  const size_t n = p.at("logit_opacities").size();
  Gaussians g{std::vector<double>(3 * n), std::vector<double>(9 * n), std::vector<double>(n),
              std::vector<double>(3 * n), std::vector<double>(3 * n), std::vector<double>(9 * n)};
  for (size_t i = 0; i < n; ++i) {
    const Native4d row = native4d_row(p, i);
    const Slice a = slice_at(row, cut.t1), b = slice_at(row, cut.t2);
    add_row3(g.means, i, a.mean);
    add_rows9(g.factors, i, a.factor);
    g.opacities[i] = a.life.opacity;
    add_row3(g.colors, i, sh_color(p, i, cut.degree, a.mean, camera_centre(cut.camera)));
    add_row3(g.means_t2, i, b.mean);
    add_rows9(g.factors_t2, i, b.factor);
  }
  return g;
}
inline Named native4d_vjp(const Named& p, const Cut& cut, const Gaussians& v) {
  Named g = zeros_like(p);
  for (size_t i = 0; i < v.count(); ++i) {
    const Native4d row = native4d_row(p, i);
    const real3 v_mean =
        row3(v.means, i) + sh_color_vjp(p, i, cut.degree, slice_at(row, cut.t1).mean,
                                        camera_centre(cut.camera), row3(v.colors, i), g);
    add_native4d_row(g, i, slice_vjp(row, cut.t1, v_mean, rows9(v.factors, i), v.opacities[i]));
    add_native4d_row(g, i, slice_vjp(row, cut.t2, row3(v.means_t2, i), rows9(v.factors_t2, i), 0));
  }
  return g;
}

}  // namespace gflow::reference
