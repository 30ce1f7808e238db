// SPDX-License-Identifier: Apache-2.0
// Any motion model as straight pieces of path, for files that hold no others.
#pragma once
#include <functional>

#include "optim/formats/four_dgs.hpp"
#include "optim/model/model.hpp"

namespace gflow {

// The model is sampled at `steps` times from 0 to 1, which lie 1/fps seconds apart. A piece goes on
// to the next sample as long as a straight line is within `shift` of all its samples and one shape
// is like all of them; so what rests or moves evenly is one piece, and what bends or turns fast is
// a piece a step, each with the shape of its beginning. A Gaussian's life is kept as it is.
struct PieceRule {
  int steps = 2;        // at least 1
  double fps = 24;      // > 0
  double shift = 0.05;  // [sizes of the Gaussian, cube root of the product of its scales]
  double shape = 0.05;  // most change of L L^T, relative (Frobenius)
};

// The last sample is shown for as long as every other: the duration is steps / fps. after_step: is
// called after each. Error for a rule out of range.
MovingSplats linear_pieces(
    Queue& queue, Model& model, const PieceRule& rule,
    const std::function<void()>& after_step = [] {});

}  // namespace gflow
