// SPDX-License-Identifier: Apache-2.0
// Motion model and static/dynamic split (settings motion.*).
#pragma once
#include <array>

#include "optim/motion/models.hpp"
#include "runtime/base/option.hpp"

namespace gflow {

// motion.model: `automatic` (chosen by the scene), or a MotionModelKind plus one.
enum class MotionChoice { automatic };
constexpr MotionChoice choice_of(MotionModelKind kind) { return MotionChoice(int(kind) + 1); }
inline std::vector<const char*> names_of(MotionChoice) {
  std::vector<const char*> names = names_of(MotionModelKind{});
  names.insert(names.begin(), "auto");
  return names;
}

struct MotionOptions {
  MotionChoice model = MotionChoice::automatic;
  int keys = 0;
  bool key_scales = false;
  int bases = 8;
  int sh_degree = 2;
  int sh_interval = 1000;
  float cutoff = 0.05f;
  float duration = 8;
  float static_threshold = 0;
  int static_every = 500;
  float wake_threshold = 5;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("model", self.model,
          "how the Gaussians move: spacetime (curved paths, turning), native4d (4D Gaussians), "
          "keyframes (free paths through keys), bases (a few rigid motions shared by all), "
          "hexplane (one pose and a field that shifts it); auto: hexplane where one camera at a "
          "time sees the scene, else spacetime");
    field("keys", self.keys, "keyframes, bases: moments that hold the paths; 0: one a time step",
          between(0, 10000));
    field("key_scales", self.key_scales, "keyframes: sizes change along the keys, too");
    field("bases", self.bases, "bases: rigid motions", between(1, 32));
    field("duration", self.duration,
          advanced("length of the video in the model's time [x scene extent]: a speed of 1 crosses "
                   "so much"),
          above(0));
    field("sh_degree", self.sh_degree, "highest degree of the spherical harmonics", between(0, 3));
    field("sh_interval", self.sh_interval, advanced("steps between two rises of the degree in use"),
          at_least(1));
    field("cutoff", self.cutoff, advanced("a Gaussian whose temporal opacity is lower is skipped"),
          between(0, 0.5f));
    field("static_threshold", self.static_threshold,
          "a Gaussian that moves and turns by less than this loses the parameters of its motion "
          "[its own size]; 0: all keep them",
          at_least(0));
    field("static_every", self.static_every,
          advanced("steps between two rounds that decide who rests"), at_least(1));
    field("wake_threshold", self.wake_threshold,
          advanced("who rests moves again when what pulls at it adds up to so many times what "
                   "chance would; "
                   "0: only by growing"),
          at_least(0));
  }
};

}  // namespace gflow
