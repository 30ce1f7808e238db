// SPDX-License-Identifier: Apache-2.0
// Density control: number and placement of Gaussians (settings density.*).
#pragma once
#include <array>

#include "runtime/base/option.hpp"

namespace gflow {

enum class DensityKind { adc, mcmc };
constexpr std::array<const char*, 2> names_of(DensityKind) { return {"adc", "mcmc"}; }

struct DensityOptions {
  bool enabled = true;
  DensityKind strategy = DensityKind::adc;
  int start = 500;
  float stop_fraction = 0.5f;
  int every = 100;
  int cap = 0;
  int memory = 0;
  float prune_opacity = 0.02f;
  float grad_threshold = 2e-4f;
  bool absgrad = false;
  float split_scale = 0.01f;
  float split_travel = 1;
  float min_lifetime = 1;
  float prune_scale = 0.5f;
  float prune_hidden = 0.2f;
  int opacity_reset_every = 0;
  float growth = 0.05f;
  float spread = 0.5f;
  float noise = 1e5f;
  float opacity_weight = 0.01f;
  float scale_weight = 0.01f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("enabled", self.enabled, "add, move and remove Gaussians");
    field(
        "strategy", self.strategy,
        "adc: clone, split and prune by gradients; mcmc: move the faintest to others, with noise");
    field("start", self.start, "first step", at_least(0));
    field("stop_fraction", self.stop_fraction, "last step, as a share of train.iterations",
          between(0, 1));
    field("every", self.every, "steps between two rounds", at_least(1));
    field("cap", self.cap,
          "maximum number of Gaussians; 0: by the scene, 0.4 per pixel of an image, at least 30000",
          at_least(0));
    field("memory", self.memory,
          "memory limit for adding Gaussians [MiB]; 0: three quarters of the device's memory",
          at_least(0));
    field("prune_opacity", self.prune_opacity,
          "opacity below which Gaussians are removed (mcmc: moved)", above_up_to(0, 0.99f));
    field("grad_threshold", self.grad_threshold,
          "adc: grow where the mean image-space gradient exceeds this [1 / half the image]",
          at_least(0));
    field("absgrad", self.absgrad,
          advanced("adc: sum absolute gradients over pixels, so that they do not cancel; needs a "
                   "higher grad_threshold"));
    field("split_scale", self.split_scale,
          advanced("adc: split larger Gaussians, clone smaller ones [x scene extent]"), above(0));
    field("split_travel", self.split_travel,
          advanced("adc: split in time Gaussians that travel further [x their size]"), above(0));
    field("min_lifetime", self.min_lifetime,
          advanced("adc: shortest lifetime after a split [time steps]"), above(0));
    field("prune_scale", self.prune_scale,
          advanced(
              "adc: remove larger Gaussians [x scene extent, or x the median depth of the scene's "
              "points where that is larger]"),
          above(0));
    field("prune_hidden", self.prune_hidden,
          advanced("nodes, hexplane: remove Gaussians of which no training view shows this share, "
                   "others being in front; 0: off"),
          between(0, 1));
    field("opacity_reset_every", self.opacity_reset_every,
          advanced("adc: steps between two resets of all opacities to at most 2 x prune_opacity; "
                   "0: never"),
          at_least(0));
    field("growth", self.growth, advanced("mcmc: share of Gaussians added per round"), at_least(0));
    field("spread", self.spread,
          advanced("mcmc: separation of Gaussians moved to the same place [x their size]"),
          at_least(0));
    field("noise", self.noise,
          advanced("mcmc: noise on the positions seen in a step [x their learning rate x "
                   "covariance, in extents]"),
          at_least(0));
    field("opacity_weight", self.opacity_weight,
          advanced("mcmc: weight of the mean opacity relative to the image loss"), at_least(0));
    field("scale_weight", self.scale_weight,
          advanced("mcmc: weight of the mean size relative to the image loss [1 / scene extent]"),
          at_least(0));
  }
};

}  // namespace gflow
