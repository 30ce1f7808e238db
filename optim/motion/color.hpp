// SPDX-License-Identifier: Apache-2.0
// Colour by spherical harmonics (kernels/motion/sh.cl). Groups: sh0 [N,3] and sh_rest [N,(d+1)^2 -
// 1, 3] for the highest degree d.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/motion/view_rows.hpp"

namespace gflow {

// Groups for the highest degree, 0 to 3.
inline std::vector<GroupSpec> color_groups(int highest) {
  return {{"sh0", 3, Quantity::color},
          {"sh_rest", size_t(3 * ((highest + 1) * (highest + 1) - 1)), Quantity::color_rest}};
}

// Bands of spherical harmonics that a view uses.
struct Bands {
  int degree;  // higher bands count as 0
  int walked;  // highest band that kernels read, `degree` to the stored one; does not change
               // colours
};

class Color {
 public:
  // highest: degree that the parameters have room for, 0 to 3.
  Color(Queue& queue, int highest)
      : highest_(highest),
        program_(queue, "common.cl"),
        sh_fwd_(program_, "sh_fwd"),
        sh_bwd_(program_, "sh_bwd") {}

  // Bands up to `degree`. With `skip` (settings.hpp) higher bands are not read.
  Bands bands(int degree, bool skip) const { return {degree, skip ? degree : highest_}; }

  // Sets colors [n, 3] of Gaussians with tiles_touched > 0; the others are undefined. Arrays of the
  // view have one entry per entry of `rows`.
  void forward(Queue& queue, const Parameters& p, Bands bands, const PinholeCamera& camera,
               const GaussiansAt& gaussians, const Buffer<cl_uint>& tiles_touched,
               Buffer<float>& colors, const RowList& rows = {}) {
    const size_t n = rows.count_of(p);
    colors.ensure(queue, 3 * n);
    sh_fwd_(queue, Range::over(n), cl_uint(n), bands.degree, bands.walked, stride(), camera,
            rows.buffer(), gaussians.means, tiles_touched, p["sh0"].values, p["sh_rest"].values,
            colors);
  }

  // Backward pass from v.v_colors to the groups' gradients and to v.v_means (the view direction
  // depends on the mean). sh_rest gets gradients only in the bands that are read. Call it before
  // Motion::backward, which marks rows as seen.
  void backward(Queue& queue, Parameters& p, Bands bands, const PinholeCamera& camera,
                const GaussiansAt& gaussians, const Buffer<cl_uint>& tiles_touched,
                GaussianGradients& v, const RowList& rows = {}) {
    const size_t n = rows.count_of(p);
    sh_bwd_(queue, Range::over(n), cl_uint(n), bands.degree, bands.walked, stride(), camera,
            rows.buffer(), gaussians.means, p["sh0"].values, p["sh_rest"].values, tiles_touched,
            p.rows.seen, v.v_colors, p["sh0"].grads, p["sh_rest"].grads, v.v_means);
  }

 private:
  int stride() const { return (highest_ + 1) * (highest_ + 1) - 1; }

  int highest_;
  Program program_;
  Kernel<cl_uint, cl_int, cl_int, cl_int, PinholeCamera, In<cl_uint>, In<float>, In<cl_uint>,
         In<float>, In<float>, Out<float>>
      sh_fwd_;
  Kernel<cl_uint, cl_int, cl_int, cl_int, PinholeCamera, In<cl_uint>, In<float>, In<float>,
         In<float>, In<cl_uint>, In<cl_uint>, In<float>, Out<float>, Out<float>, Out<float>>
      sh_bwd_;
};

}  // namespace gflow
