// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace gflow {

// A rectangle of an image [px].
struct Rect {
  int x = 0, y = 0, width = 0, height = 0;
};

}  // namespace gflow
