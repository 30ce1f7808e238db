// SPDX-License-Identifier: Apache-2.0
// kernels/checks/stress.cl as functions: arrays of cases in, arrays of results out.
#pragma once
#include <string>
#include <vector>

#include "optim/engine/gaussians.hpp"
#include "optim/engine/settings.hpp"
#include "shared/transport.h"

namespace gflow::stress {

using Floats = std::vector<float>;

class DeviceMaths {
 public:
  explicit DeviceMaths(Queue& queue);

  struct Roots {
    Floats maps, gradients;  // [n, 4] A; [n, 6] dL/dS1, dL/dS2 as symmetric matrices
  };
  Roots roots(const Floats& pairs, const Floats& g);

  struct Whitened {
    Floats dets, z;  // [n], [n, 2]
  };
  Whitened whiten(const Floats& factors, const Floats& offsets);

  struct Transported {
    Floats h, v_m1, v_m2;  // [n, 4], [n, 6], [n, 6]
  };
  Transported transport(int mode, const Floats& m1, const Floats& m2, const Floats& gh);

  struct Projected {
    Floats means2d, m, v_means, v_factors;  // [n, 2], [n, 6], [n, 3], [n, 9]
  };
  Projected project(const PinholeCamera& camera, const Floats& means, const Floats& factors,
                    const Floats& v_means2d, const Floats& v_depths, const Floats& v_m);

 private:
  Queue& queue_;
  Program program_;
  Kernel<cl_uint, In<float>, In<float>, Out<float>, Out<float>> roots_;
  Kernel<cl_uint, In<float>, In<float>, Out<float>, Out<float>> whiten_;
  Kernel<cl_uint, cl_int, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>>
      transport_;
  Kernel<cl_uint, PinholeCamera, In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>,
         Out<float>, Out<float>, Out<float>>
      project_;
};

// Names of the modes of shared/transport.h.
inline std::string mode_name(int mode) { return name_of(Transport(mode)); }

}  // namespace gflow::stress
