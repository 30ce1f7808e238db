// SPDX-License-Identifier: Apache-2.0
// Where something moves between two images of a camera that stands still.
#pragma once
#include <vector>

#include "optim/images/image.hpp"
#include "optim/images/rect.hpp"

namespace gflow {

// Disjoint rectangles around all pixels that differ by more than noise, with a margin. What moves
// is in one of them at both times if its edges touch or the margin joins them. a, b: RGB, of equal
// size.
std::vector<Rect> changed_regions(const Image& a, const Image& b);

}  // namespace gflow
