// SPDX-License-Identifier: Apache-2.0
// What one may choose about the image and its flow, with the names users write.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/error.hpp"
#include "shared/transport.h"

namespace gflow {

// How a splat carries pixels from t1 to t2 (shared/transport.h); the values are the kernels'.
enum class Transport {
  paper = TRANSPORT_PAPER,
  ot = TRANSPORT_OT,
  material = TRANSPORT_MATERIAL,
  translate = TRANSPORT_TRANSLATE,
};
// Whether the splat that saturates a pixel is still drawn.
enum class StopRule { include, exclude };

// Their names for users, in the order of the enumerators, which count from 0.
constexpr std::array<const char*, 4> names_of(Transport) {
  return {"paper", "ot", "material", "translate"};
}
constexpr std::array<const char*, 2> names_of(StopRule) { return {"include", "exclude"}; }
template <class Enum>
constexpr const char* name_of(Enum value) {
  return names_of(value)[static_cast<size_t>(value)];
}

// Work that is left out. `boxes`, `masks`, `saturated`, `asking`, `flow`, `bands` and `compact`
// change no bit of an image or a gradient (but the sign of a 0), but without boxes more Gaussians
// count as seen; `outside` none either, but for the last bits of what `bases` share; `still`
// changes the last bits of gradients, since sums that are 0 are not formed; `unseen` those of
// steps, which a Gaussian makes up for when it is seen again (shared/adam.h; with adam.beta1 above
// 0 what the mean gradient would do meanwhile is left out).
struct Skips {
  bool boxes = true;      // tiles outside the box of the ellipse where alpha >= 1/255 (project.cl)
  bool masks = true;      // cells of a tile outside that ellipse (cell_mask.cl)
  bool saturated = true;  // a tile's list from where nothing passes through it (splat.cl)
  bool asking = true;     // the way back through cells where every gradient is 0 (splat_bwd.cl)
  bool outside = true;  // rows of other moments and outside the picture (motion/view_rows.hpp), but
                        // in steps with a motion loss, or with mcmc, which pose all
  bool still = true;    // the second time of what rests before a camera at rest (View::moving)
  bool flow = true;     // flow in tiles where nothing moves, its gradients where none are asked for
  bool bands = true;    // spherical harmonics, and their Adam, above the degree in use (sh.cl)
  bool compact = true;  // three quarters of a picture on the device: bytes, not floats
  bool unseen = true;   // Adam's steps of Gaussians that no picture of a step shows

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("boxes", self.boxes,
          "tiles outside the box in which a splat can be seen; off: a square around its circle");
    field("masks", self.masks, "cells of 4x4 pixels in which it cannot");
    field("saturated", self.saturated, "what lies behind where a whole tile is opaque");
    field("asking", self.asking, "gradients of cells of pixels that are exactly right");
    field(
        "outside", self.outside,
        "Gaussians of other moments and those that the camera cannot see, before anything is made "
        "of them");
    field("still", self.still, "the second time of Gaussians at rest before a camera at rest");
    field("flow", self.flow,
          "flow in tiles where all is at rest, its gradients in tiles that ask for none");
    field("bands", self.bands, "bands of the spherical harmonics that are not in use yet");
    field("compact", self.compact,
          "three quarters of the bytes of a picture on the device, decoded there; off: floats");
    field("unseen", self.unseen,
          "optimiser steps of Gaussians that no picture of the step shows, made up for later");
  }
};

struct EngineSettings {
  Transport transport = Transport::material;
  StopRule stop = StopRule::include;
  int top_k = 0;                // contributors a pixel's flow is made of; 0 = all, the paper has 20
  bool detach_t1 = false;       // no flow gradient to the geometry at t1
  bool detach_weights = false;  // no flow gradient to the weights, i.e. to what is drawn where
  bool absgrad = false;         // v_means2d from sums of |gradient| over pixels; not with depth
  Skips skip;
  std::vector<std::pair<std::string, std::string>> defines;  // others for its kernels: gflow bench
};

// The defines of a kernel file, and those.
template <class Defines>
Defines with_more(Defines defines, const EngineSettings& settings) {
  for (const auto& [name, value] : settings.defines) defines.emplace_back(name, value);
  return defines;
}

// Which images are wanted beside colour and alpha; what is not wanted costs nothing.
struct Channels {
  bool flow = true;
  bool depth = true;
};

// The moment of the depth carries the sums of |gradient|: one or the other.
inline bool absgrad(const EngineSettings& settings, Channels channels) {
  return settings.absgrad && !channels.depth;
}

// The value of that name; Error that lists the choices.
template <class Enum>
Enum value_named(const std::string& name) {
  const auto names = names_of(Enum{});
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw Error(fmt::format("there is no '{}', only {}", name, fmt::join(names, ", ")));
  return Enum(found - names.begin());
}

}  // namespace gflow
