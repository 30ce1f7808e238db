// SPDX-License-Identifier: Apache-2.0
// Planes, network and schedule of the hexplane model (settings hexplane.*).
#pragma once
#include <array>

#include "runtime/base/option.hpp"

namespace gflow {

struct HexplaneOptions {
  int levels = 2;
  int channels = 16;
  int resolution = 32;
  int times = 0;
  int hidden = 64;
  int layers = 2;
  float slack = 0.5f;
  int warmup = 300;
  float curriculum = 0.1f;
  float means = 2e-4f;
  float opacity = 0.01f;
  float grad_threshold = 1e-4f;
  bool turn = true;
  bool resize = true;
  float plane_tv = 0;
  float time_smoothness = 0.01f;
  float l1_time = 0;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("levels", self.levels, advanced("levels of planes, each twice as fine in space"),
          between(1, 4));
    field("channels", self.channels, advanced("features per level"), one_of({16, 32, 64}));
    field("resolution", self.resolution, "cells along x, y and z at the first level",
          between(2, 1024));
    field(
        "times", self.times,
        advanced("rows of the time planes; 0: one per four time steps, or up to 25 at one per two"),
        between(0, 10000));
    field("hidden", self.hidden, advanced("neurons per hidden layer"), one_of({32, 64, 128, 256}));
    field("layers", self.layers, advanced("number of hidden layers"), between(1, 4));
    field("slack", self.slack, advanced("margin around the initial Gaussians [x their extent]"),
          at_least(0));
    field("warmup", self.warmup,
          advanced("warm-up: first steps, without motion; at most a fifth of all"), at_least(0));
    field("curriculum", self.curriculum,
          "share of the training during which frames widen from the middle of the video to all of "
          "it; 0: all at once",
          between(0, 1));
    field("means", self.means,
          advanced("learning rate instead of lr.means, because one pose is seen at all times "
                   "[x scene extent]"),
          at_least(0));
    field("opacity", self.opacity,
          advanced("learning rate instead of lr.opacity, so that lasting Gaussians do not fade "
                   "before their position is learnt"),
          at_least(0));
    field("grad_threshold", self.grad_threshold,
          advanced("instead of density.grad_threshold, because gradients of many times cancel"),
          at_least(0));
    field("turn", self.turn, advanced("learn rotations over time"));
    field("resize", self.resize, advanced("learn changes of size over time"));
    field("plane_tv", self.plane_tv,
          advanced("weight of the squared differences between neighbours on space planes"),
          at_least(0));
    field("time_smoothness", self.time_smoothness,
          advanced("weight of the squared second differences of time planes"), at_least(0));
    field("l1_time", self.l1_time,
          advanced("weight of the distance of time planes from 1, which means no motion"),
          at_least(0));
  }
};

// The options with `times` resolved (>= 1), and the box that the planes cover.
struct HexplaneShape : HexplaneOptions {
  // 1: rows in time are the control points of a cubic B-spline, smooth in its second derivative, so
  // that a motion learned from one view at a time does not jerk; 0: values between which features
  // change linearly, as in files of older versions, which do not have this number.
  int time_spline = 0;
  std::array<float, 3> centre{0, 0, 0}, half_size{1, 1, 1};  // [world]
};

}  // namespace gflow
