// SPDX-License-Identifier: Apache-2.0
// Networks that evaluate the result (settings metrics.*).
#pragma once
#include <string>

#include "runtime/base/option.hpp"

namespace gflow {

// These settings do not affect training.
struct MetricsOptions {
  std::string lpips;
  std::string clip;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("lpips", self.lpips,
          "LPIPS network for evaluation, .onnx; empty: none; apps/metrics/README.md");
    field("clip", self.clip, "CLIP image encoder for evaluation, .onnx; empty: none");
  }
};

}  // namespace gflow
