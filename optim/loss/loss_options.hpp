// SPDX-License-Identifier: Apache-2.0
// Image loss and regularisers of motion (settings loss.*).
#pragma once
#include <array>

#include "runtime/base/option.hpp"

namespace gflow {

// Whether cameras have colours of their own. automatic: for rigs of cameras that stand still.
enum class CameraColor { automatic, off, on };
constexpr std::array<const char*, 3> names_of(CameraColor) { return {"auto", "off", "on"}; }

struct LossOptions {
  float ssim = 0.2f;
  CameraColor camera_color = CameraColor::automatic;
  float camera_color_shrink = 0.01f;
  float foreground = 3;
  float depth = 0;
  float depth_knee = 0.05f;
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
    field("camera_color", self.camera_color,
          "learn the colours of each camera, an affine map: exposure and white balance differ "
          "(on; auto: three or more cameras that stand still, not photographs of a walk); views of "
          "other cameras are "
          "rendered with the mean colours");
    field("camera_color_shrink", self.camera_color_shrink,
          advanced("weight of the squares of that map's deviations from identity"), at_least(0));
    field("foreground", self.foreground,
          "weight of the pixels of the foreground in the image loss, those of the background weigh "
          "1 (scene.masks = foreground)",
          above(0));
    field("depth", self.depth,
          "weight of the depth loss: rendered depth against the files in depth/ (scene.depth says "
          "what they hold); 0: off",
          at_least(0));
    field("depth_knee", self.depth_knee,
          advanced("relative error of the depth from which the loss grows linearly"), above(0));
    field("rigidity", self.rigidity, "weight: neighbours move as their rotations predict; 0: off",
          at_least(0));
    field("rotation", self.rotation, "weight: neighbours rotate alike; 0: off", at_least(0));
    field("isometry", self.isometry, "weight: neighbours keep their distance; 0: off", at_least(0));
    field("velocity", self.velocity, "weight: neighbours move alike; 0: off", at_least(0));
    field("acceleration", self.acceleration, "weight: paths do not bend; 0: off", at_least(0));
    field("neighbours", self.neighbours, advanced("nearest Gaussians used as neighbours of each"),
          between(1, 100));
    field("neighbour_falloff", self.neighbour_falloff,
          advanced("weight of a neighbour at distance d: exp(-this (d / median distance)^2)"),
          at_least(0));
    field(
        "neighbours_every", self.neighbours_every,
        advanced("steps between two neighbour searches; also after each round of density control"),
        at_least(1));
    field("motion_every", self.motion_every,
          advanced("apply the weights above, except ssim, in every n-th step, multiplied by n (6: "
                   "with train.focus = 5 the steps on whole images)"),
          at_least(1));
  }
};

}  // namespace gflow
