// SPDX-License-Identifier: Apache-2.0
// Rendering of views (settings render.*).
#pragma once
#include "runtime/base/option.hpp"

namespace gflow {

struct ViewOptions {
  float near = 0;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("near", self.near,
          "Gaussians nearer to the camera are not drawn [scene units]; 0: by the scene, from its "
          "depth range, points or size",
          at_least(0));
  }
};

}  // namespace gflow
