// SPDX-License-Identifier: Apache-2.0
// Rendering of views (settings render.*).
#pragma once
#include "runtime/base/option.hpp"

namespace gflow {

struct ViewOptions {
  float near = 0.05f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("near", self.near, "skip Gaussians closer to the camera [scene units]", above(0));
  }
};

}  // namespace gflow
