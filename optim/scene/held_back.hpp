// SPDX-License-Identifier: Apache-2.0
// The setting scene.val_every: training views that are held back for validation.
#pragma once
#include "optim/scene/scene.hpp"

namespace gflow {

// Moves every n-th camera of the training split, in the order of tracks, to the validation split;
// of a scene with one camera every n-th image. At least one, where two remain; the first stays. The
// steps are those that training frames still have. Nothing if n is 0; Error if nothing can be held
// back.
void hold_back(Scene& scene, int n);

}  // namespace gflow
