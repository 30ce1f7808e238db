// SPDX-License-Identifier: Apache-2.0
// Colour by spherical harmonics (kernels/sh.cl). Groups: sh0 [N,3] and sh_rest [N,(d+1)^2 - 1, 3]
// for the highest degree d.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/motion/view_rows.hpp"

namespace gflow {

// Groups for the highest degree, 0 to 3.
inline std::vector<GroupSpec> color_groups(int highest) {
  return {{"sh0", 3, Quantity::color},
          {"sh_rest", size_t(3 * ((highest + 1) * (highest + 1) - 1)), Quantity::color_rest}};
}

// What is shown of the harmonics, and how far they are walked through.
struct Bands {
  int degree;  // those above count as 0
  int walked;  // the highest that is looked at, from `degree` to what is stored: nobody sees which
};

class Color {
 public:
  // highest: degree that the parameters have room for, 0 to 3.
  Color(Queue& queue, int highest)
      : highest_(highest),
        program_(queue, "common.cl"),
        sh_fwd_(program_, "sh_fwd"),
        sh_bwd_(program_, "sh_bwd") {}

  // Those up to `degree`; with `skip` (settings.hpp) no others are walked through.
  Bands bands(int degree, bool skip) const { return {degree, skip ? degree : highest_}; }

  // colors [n, 3] of what is seen; the others are undefined. The Gaussians, and all else of the
  // view, have an entry for each of `rows`.
  void forward(Queue& queue, const Parameters& p, Bands bands, const PinholeCamera& camera,
               const GaussiansAt& gaussians, const Buffer<cl_uint>& tiles_touched,
               Buffer<float>& colors, const RowList& rows = {}) {
    const size_t n = rows.count_of(p);
    colors.ensure(queue, 3 * n);
    sh_fwd_(queue, Range::over(n), cl_uint(n), bands.degree, bands.walked, stride(), camera,
            rows.buffer(), gaussians.means, tiles_touched, p["sh0"].values, p["sh_rest"].values,
            colors);
  }

  // From v.v_colors to the groups' gradients, those of sh_rest only where bands of it are walked
  // through, and to v.v_means (the view direction depends on the mean). To be called before
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
