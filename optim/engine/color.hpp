// SPDX-License-Identifier: Apache-2.0
// Colour by spherical harmonics (kernels/sh.cl). Groups: sh0 [N,3] and sh_rest [N,(d+1)^2 - 1, 3]
// for the highest degree d.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/motion/parameters.hpp"

namespace gflow {

// Groups for the highest degree, 0 to 3.
inline std::vector<GroupSpec> color_groups(int highest) {
  return {{"sh0", 3, Quantity::color},
          {"sh_rest", size_t(3 * ((highest + 1) * (highest + 1) - 1)), Quantity::color_rest}};
}

class Color {
 public:
  // highest: degree that the parameters have room for, 0 to 3.
  Color(Queue& queue, int highest)
      : stride_((highest + 1) * (highest + 1) - 1),
        program_(queue, "common.cl"),
        sh_fwd_(program_, "sh_fwd"),
        sh_bwd_(program_, "sh_bwd") {}

  // colors [N, 3] with the bands up to `degree`, of what is seen; the others are undefined.
  void forward(Queue& queue, const Parameters& p, int degree, const PinholeCamera& camera,
               const GaussiansAt& gaussians, const Buffer<cl_uint>& tiles_touched,
               Buffer<float>& colors) {
    colors.ensure(queue, 3 * p.count);
    sh_fwd_(queue, Range::over(p.count), cl_uint(p.count), degree, stride_, camera, gaussians.means,
            tiles_touched, p["sh0"].values, p["sh_rest"].values, colors);
  }

  // From v.v_colors to the groups' gradients and to v.v_means (the view direction depends on the
  // mean). To be called before Motion::backward, which marks rows as seen.
  void backward(Queue& queue, Parameters& p, int degree, const PinholeCamera& camera,
                const GaussiansAt& gaussians, const Buffer<cl_uint>& tiles_touched,
                GaussianGradients& v) {
    sh_bwd_(queue, Range::over(p.count), cl_uint(p.count), degree, stride_, camera, gaussians.means,
            p["sh0"].values, p["sh_rest"].values, tiles_touched, p.rows.seen, v.v_colors,
            p["sh0"].grads, p["sh_rest"].grads, v.v_means);
  }

 private:
  int stride_;
  Program program_;
  Kernel<cl_uint, cl_int, cl_int, PinholeCamera, In<float>, In<cl_uint>, In<float>, In<float>,
         Out<float>>
      sh_fwd_;
  Kernel<cl_uint, cl_int, cl_int, PinholeCamera, In<float>, In<float>, In<float>, In<cl_uint>,
         In<cl_uint>, In<float>, Out<float>, Out<float>, Out<float>>
      sh_bwd_;
};

}  // namespace gflow
