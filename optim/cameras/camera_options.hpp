// SPDX-License-Identifier: Apache-2.0
// Correction of camera poses while training (settings cameras.*).
#pragma once
#include <array>

#include "runtime/base/option.hpp"

namespace gflow {

// automatic: for cameras that `gflow cameras` estimated.
enum class RefineCameras { automatic, off, on };
constexpr std::array<const char*, 3> names_of(RefineCameras) { return {"auto", "off", "on"}; }

struct CameraOptions {
  RefineCameras refine = RefineCameras::automatic;
  float start = 0.1f;
  float pull = 0.1f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("refine", self.refine,
          "train the cameras too, their poses and a common focal length (on; auto: if `gflow "
          "cameras` has estimated them); cameras of other views are then fitted to their images "
          "before they are evaluated");
    field(
        "start", self.start,
        advanced("share of the steps before: a scene that is hardly known leads cameras astray (0 "
                 "where a background is trained first, init.background)"),
        between(0, 1));
    field("pull", self.pull,
          advanced("weight of the squares of their corrections, of angles and of shifts relative "
                   "to the depth of the scene"),
          at_least(0));
  }
};

}  // namespace gflow
