// SPDX-License-Identifier: Apache-2.0
// Choices for rendering and flow, with their names in settings.
#pragma once
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/option.hpp"
#include "shared/transport.h"

namespace gflow {

// How a splat carries pixels from t1 to t2 (shared/transport.h); values are those of the kernels.
enum class Transport {
  paper = TRANSPORT_PAPER,
  ot = TRANSPORT_OT,
  material = TRANSPORT_MATERIAL,
  translate = TRANSPORT_TRANSLATE,
};
// Whether the splat that saturates a pixel is still drawn.
enum class StopRule { include, exclude };

// Names in settings, in the order of the enumerators, which count from 0.
constexpr std::array<const char*, 4> names_of(Transport) {
  return {"paper", "ot", "material", "translate"};
}
constexpr std::array<const char*, 2> names_of(StopRule) { return {"include", "exclude"}; }

// Work that can be skipped. `boxes`, `masks`, `saturated`, `zero_gradients`, `flow` and `bands`
// change no bit of an image or gradient (except the sign of a 0), but without `boxes` more
// Gaussians count as visible. `culled` changes none either, except the last bits of what `bases`
// share. `static_pose` changes the last bits of gradients, because sums that are 0 are not formed.
// `unseen` changes the last bits of Adam steps; a Gaussian catches up when it is visible again
// (shared/adam.h), but with adam.beta1 > 0 the moves by its mean gradient in between are lost.
struct Skips {
  bool boxes = true;  // tiles outside the bounding box of the ellipse alpha >= 1/255 (project.cl)
  bool masks = true;  // 4x4 cells of a tile outside that ellipse (cell_mask.cl)
  bool saturated = true;  // rest of a tile's list once all its pixels are saturated (splat_fwd)
  bool zero_gradients = true;  // backward pass in cells where every gradient is 0 (splat_bwd)
  bool culled = true;       // rows absent at this time or outside the image (motion/view_rows.hpp),
                            // except in steps with a motion loss or mcmc, which pose all rows
  bool static_pose = true;  // t2 of static Gaussians seen by a static camera (View::moving)
  bool flow = true;         // flow in tiles where nothing moves; its gradients where v_flow is 0
  bool bands = true;        // SH bands, and their Adam steps, above the degree in use (sh.cl)
  bool unseen = true;       // Adam steps of Gaussians that no image of the step shows

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field(
        "boxes", self.boxes,
        advanced(
            "tiles outside the bounding box of a splat; off: outside a square around its circle"));
    field("masks", self.masks, advanced("cells of 4x4 pixels outside the ellipse of a splat"));
    field("saturated", self.saturated,
          advanced("Gaussians behind a tile whose pixels are all saturated"));
    field("zero_gradients", self.zero_gradients,
          advanced("backward pass in cells of pixels without gradients"));
    field("culled", self.culled,
          advanced("Gaussians absent at the time or outside the image, before they are posed"));
    field("static_pose", self.static_pose,
          advanced("second pose of static Gaussians seen by a static camera"));
    field("flow", self.flow,
          advanced("flow in tiles without motion, and its gradients in tiles without flow loss"));
    field("bands", self.bands,
          advanced("bands of the spherical harmonics above the degree in use"));
    field("unseen", self.unseen,
          advanced("optimiser steps of Gaussians that no image of the step shows, applied later"));
  }
};

struct EngineSettings {
  Transport transport = Transport::material;
  StopRule stop = StopRule::include;
  int top_k = 0;                // contributors to a pixel's flow; 0: all; the paper uses 20
  bool detach_t1 = false;       // no flow gradient to the geometry at t1
  bool detach_weights = false;  // no flow gradient to the blending weights
  bool absgrad = false;         // v_means2d from sums of |gradient| over pixels; not with depth
  Skips skip;
  std::vector<std::pair<std::string, std::string>> defines;  // more, for gflow bench
};

// The defines of a kernel file and those of the settings.
template <class Defines>
Defines with_more(Defines defines, const EngineSettings& settings) {
  for (const auto& [name, value] : settings.defines) defines.emplace_back(name, value);
  return defines;
}

// Images to render besides colour and alpha; others cost nothing.
struct Channels {
  bool flow = true;
  bool depth = true;
};

// absgrad uses the slot of the depth moment, so only one of the two is available.
inline bool absgrad(const EngineSettings& settings, Channels channels) {
  return settings.absgrad && !channels.depth;
}

}  // namespace gflow
