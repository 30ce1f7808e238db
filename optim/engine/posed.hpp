// SPDX-License-Identifier: Apache-2.0
// Gaussians given at each time by means, quaternions and linear scales, as used by `gflow splat`
// and the tests.
#pragma once
#include "optim/engine/gaussians.hpp"

namespace gflow {

class Posed {
 public:
  explicit Posed(Queue& queue)
      : program_(queue, "engine/posed.cl"),
        posed_fwd_(program_, "posed_fwd"),
        posed_bwd_(program_, "posed_bwd") {}

  // factors [N, 3, 3] = R(q/|q|) diag(scales) from quats [N, 4] (w x y z) and scales [N, 3].
  void forward(Queue& queue, const Buffer<float>& quats, const Buffer<float>& scales,
               Buffer<float>& factors) {
    const size_t n = scales.size() / 3;
    factors.ensure(queue, 9 * n);
    posed_fwd_(queue, Range::over(n), cl_uint(n), quats, scales, factors);
  }
  void backward(Queue& queue, const Buffer<float>& quats, const Buffer<float>& scales,
                const Buffer<float>& v_factors, Buffer<float>& v_quats, Buffer<float>& v_scales) {
    const size_t n = scales.size() / 3;
    v_quats.ensure(queue, 4 * n);
    v_scales.ensure(queue, 3 * n);
    posed_bwd_(queue, Range::over(n), cl_uint(n), quats, scales, v_factors, v_quats, v_scales);
  }

 private:
  Program program_;
  Kernel<cl_uint, In<float>, In<float>, Out<float>> posed_fwd_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, Out<float>, Out<float>> posed_bwd_;
};

}  // namespace gflow
