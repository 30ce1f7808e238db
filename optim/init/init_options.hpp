// SPDX-License-Identifier: Apache-2.0
// Initial Gaussians (settings init.*).
#pragma once
#include <array>
#include <string>

#include "runtime/base/option.hpp"

namespace gflow {

enum class InitFrom { automatic, points, stereo, random, visual_hull, file };
constexpr std::array<const char*, 6> names_of(InitFrom) {
  return {"auto", "points", "stereo", "random", "visual-hull", "file"};
}

struct InitOptions {
  InitFrom from = InitFrom::automatic;
  std::string file;
  int count = 10000;
  float opacity = 0.1f;
  float lifetime = 1;
  float box = 1;
  int dynamic = 6000;
  float dynamic_lifetime = 1;

  // Whether Gaussians come from init.file.
  bool begins_from_file() const {
    return from == InitFrom::file || (from == InitFrom::automatic && !file.empty());
  }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("from", self.from,
          "first Gaussians: the scene's points; stereo: points on whose colours several cameras "
          "agree; "
          "random ones in a box; visual-hull: random ones on the object, by the pictures' alpha; "
          "those "
          "of a file; auto: file, points, visual-hull, stereo, random, the first that there is");
    field(
        "file", self.file,
        "splat that stands still, in the scene's coordinates: .ply, compressed .ply, .splat, .spz");
    field("count", self.count, "random or stereo points", at_least(1));
    field("opacity", self.opacity, "first opacity", above_up_to(0, 0.99f));
    field("box", self.box, advanced("side of the box of random points [x scene extent]"), above(0));
    field("dynamic", self.dynamic,
          "short-lived Gaussians where three or more fixed cameras see something move; 0: none",
          at_least(0));
    field("dynamic_lifetime", self.dynamic_lifetime,
          advanced("their standard deviation in time [time steps]"), above(0));
    field("lifetime", self.lifetime, advanced("standard deviation in time [lengths of the video]"),
          above(0));
  }
};

}  // namespace gflow
