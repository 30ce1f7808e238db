// SPDX-License-Identifier: Apache-2.0
// Approximates any motion model by linear pieces of path, for file formats that store only these.
#pragma once
#include <functional>

#include "optim/formats/four_dgs.hpp"
#include "optim/model/model.hpp"

namespace gflow {

// The model is sampled at `steps` times from 0 to 1, 1/fps seconds apart. A piece is extended to
// the next sample while one straight line is within `shift` of all its samples and one shape fits
// them all. So a static or uniformly moving Gaussian is one piece; one that bends or turns fast is
// one piece per step, with the shape at its beginning. Lifetimes are kept.
struct PieceRule {
  int steps = 2;        // at least 1
  double fps = 24;      // > 0
  double shift = 0.05;  // tolerance of the mean [x the Gaussian's size, cube root of the product of
                        // its scales]
  double shape = 0.05;  // largest relative change of L L^T (Frobenius)
};

// The last sample is shown as long as every other, so the duration is steps / fps. after_step is
// called after each sample. Error if the rule is out of range.
MovingSplats linear_pieces(
    Queue& queue, Model& model, const PieceRule& rule,
    const std::function<void()>& after_step = [] {});

}  // namespace gflow
