// SPDX-License-Identifier: Apache-2.0
// Image loss and regularisers of motion (settings loss.*).
#pragma once
#include "runtime/base/option.hpp"

namespace gflow {

struct LossOptions {
  float ssim = 0.2f;
  float rigidity = 0;
  float rotation = 0;
  float isometry = 0;
  float velocity = 0;
  float acceleration = 0;
  int neighbours = 8;
  float neighbour_falloff = 0.5f;
  int neighbours_every = 500;
  int motion_every = 6;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("ssim", self.ssim, "share of 1 - SSIM in the image loss; the rest is L1", between(0, 1));
    field("rigidity", self.rigidity,
          "weight: neighbours move as the turn of each says; 0: off, as the next four",
          at_least(0));
    field("rotation", self.rotation, "weight: neighbours turn alike", at_least(0));
    field("isometry", self.isometry, "weight: neighbours keep their distance", at_least(0));
    field("velocity", self.velocity, "weight: neighbours move alike", at_least(0));
    field("acceleration", self.acceleration, "weight: paths do not bend", at_least(0));
    field("neighbours", self.neighbours, advanced("nearest Gaussians that each is a neighbour of"),
          between(1, 100));
    field("neighbour_falloff", self.neighbour_falloff,
          advanced("neighbours at distance d count exp(-this (d / median of the distances)^2)"),
          at_least(0));
    field(
        "neighbours_every", self.neighbours_every,
        advanced(
            "steps between two searches for neighbours; also after each round of density control"),
        at_least(1));
    field("motion_every", self.motion_every,
          advanced("the weights above count in every n-th step only, n times as much (6: with "
                   "train.focus = "
                   "5 those on whole pictures)"),
          at_least(1));
  }
};

}  // namespace gflow
