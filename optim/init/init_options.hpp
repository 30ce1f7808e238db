// SPDX-License-Identifier: Apache-2.0
// Initial Gaussians (settings init.*).
#pragma once
#include <array>
#include <string>

#include "runtime/base/option.hpp"

namespace gflow {

enum class InitFrom { automatic, points, depth, stereo, random, visual_hull, file };
constexpr std::array<const char*, 7> names_of(InitFrom) {
  return {"auto", "points", "depth", "stereo", "random", "visual-hull", "file"};
}

struct InitOptions {
  InitFrom from = InitFrom::automatic;
  std::string file;
  bool strict = false;
  int count = 10000;
  float opacity = 0.1f;
  float lifetime = 1;
  float box = 1;
  int dynamic = 6000;
  int background = 1500;
  float dynamic_lifetime = 1;

  // Whether Gaussians come from init.file.
  bool begins_from_file() const {
    return from == InitFrom::file || (from == InitFrom::automatic && !file.empty());
  }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("from", self.from,
          "points: the scene's points; depth: random pixels at the depths of metric depth files; "
          "stereo: points where the colours of several cameras agree; random: random points in a "
          "box; visual-hull: random points on the object, by the images' alpha; file: Gaussians of "
          "init.file; auto: the first available of file, points, visual-hull, depth (if loss.depth "
          "uses it), stereo, random");
    field("file", self.file,
          "static splat in the scene's coordinates: .ply, compressed .ply, .splat, .spz");
    field("strict", self.strict,
          advanced("refuse a file with Gaussians that cannot be drawn, instead of leaving them "
                   "out"));
    field("count", self.count, "number of random, depth or stereo points", at_least(1));
    field("opacity", self.opacity, "initial opacity", above_up_to(0, 0.99f));
    field("box", self.box, advanced("side of the box of random points [x scene extent]"), above(0));
    field(
        "dynamic", self.dynamic,
        "number of Gaussians where three or more static cameras, or one moving camera, see motion; "
        "0: none",
        at_least(0));
    field("background", self.background,
          "scenes of one moving camera: steps that train what rests before all else, to find what "
          "moves; 0: none, everything may move from the beginning",
          at_least(0));
    field("dynamic_lifetime", self.dynamic_lifetime,
          advanced("lifetime of the short-lived Gaussians, a standard deviation [time steps]"),
          above(0));
    field("lifetime", self.lifetime,
          advanced("lifetime, a standard deviation [lengths of the video]"), above(0));
  }
};

}  // namespace gflow
