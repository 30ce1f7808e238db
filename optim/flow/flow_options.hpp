// SPDX-License-Identifier: Apache-2.0
// Optical flow: where it comes from and how it supervises (settings flow.*).
#pragma once
#include <array>
#include <string>

#include "optim/engine/settings.hpp"
#include "runtime/base/option.hpp"

namespace gflow {

enum class FlowSource { dis, files, tracks };
constexpr std::array<const char*, 3> names_of(FlowSource) { return {"dis", "files", "tracks"}; }
enum class FlowPairs { track, time };
constexpr std::array<const char*, 2> names_of(FlowPairs) { return {"track", "time"}; }
enum class FarFlow { chain, direct, tracks };
constexpr std::array<const char*, 3> names_of(FarFlow) { return {"chain", "direct", "tracks"}; }

struct FlowOptions {
  bool enabled = true;
  float weight = 0.05f;
  FlowSource source = FlowSource::dis;
  std::string folder;
  FlowPairs pairs = FlowPairs::track;
  int span = 1;
  FarFlow long_span = FarFlow::chain;
  float long_share = 0.5f;
  std::string tracks;
  Transport transport = Transport::material;
  int top_k = 0;
  StopRule stop = StopRule::include;
  bool detach_t1 = false;
  bool detach_weights = false;
  float robust_px = 0.5f;
  int every = 0;
  float low_motion = 0;
  float low_motion_px = 0.5f;
  int start = 0;
  int max_gap = 2;
  bool confidence = true;
  bool backward = true;
  float store = 8;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("enabled", self.enabled, "supervise motion with optical flow");
    field("weight", self.weight, "weight of the flow loss relative to the image loss (paper: 0.5)",
          at_least(0));
    field("source", self.source,
          "dis: computed from the images; files: read from flow.folder; tracks: point tracks");
    field("folder", self.folder,
          "flow files <camera>/<step>.flo, .flo.gz, .png, .npy, or <image>.flo ...; empty: the "
          "scene's true flow");
    field("pairs", self.pairs,
          "track: compare each frame with the next of its camera track; time: with the next in "
          "time, from any camera (source files)");
    field("span", self.span,
          "longest span [frames]: 1: neighbours; 8: also 2, 4 and 8; 0: up to the whole track",
          at_least(0));
    field("long_span", self.long_span,
          "flow over several frames: chain: chained from neighbours; direct: computed; tracks: "
          "point tracks");
    field("long_share", self.long_share,
          advanced("share of the steps with flow that use a span above 1"), between(0, 1));
    field("tracks", self.tracks,
          "point tracks: a folder with <camera>.npz, or one file; optim/flow/README.md");
    field("transport", self.transport,
          "formula by which a pixel moves with a Gaussian; optim/loss/README.md");
    field("top_k", self.top_k,
          advanced("Gaussians per pixel that contribute to flow, in depth order; 0: all"),
          at_least(0));
    field("stop", self.stop, advanced("whether the Gaussian that saturates a pixel contributes"));
    field("detach_t1", self.detach_t1,
          advanced("no gradient of the flow loss to the Gaussians at the earlier time"));
    field("detach_weights", self.detach_weights,
          advanced("no gradient of the flow loss to the blending weights"));
    field("robust_px", self.robust_px,
          advanced("knee of the robust norm: quadratic below, linear above [px]"), above(0));
    field("every", self.every,
          advanced("apply the flow loss in every n-th step, with weight n; 0: 2 for spacetime and "
                   "native4d, else 1"),
          at_least(0));
    field("low_motion", self.low_motion,
          advanced(
              "probability of sampling a 16x16 tile with zero target flow in a step, weighted by "
              "its inverse; 1: all tiles in every step; 0: 0.1 for spacetime and native4d, else 1"),
          between(0, 1));
    field("low_motion_px", self.low_motion_px,
          advanced("target flow (times its confidence) from which a tile is sampled in every step; "
                   "below, the probability is proportional to it, at least flow.low_motion [px]"),
          above(0));
    field("start", self.start, "first step with the flow loss", at_least(0));
    field("max_gap", self.max_gap, advanced("largest gap between compared frames [time steps]"),
          at_least(1));
    field("confidence", self.confidence, "ignore flow that fails the forward-backward check");
    field("backward", self.backward, "also compare with the previous frame (source dis)");
    field("store", self.store,
          "disk space for computed flow [GiB]; if all is expected to fit, at one byte per pixel, "
          "it is computed before training, else on demand, and the least recently used is dropped",
          at_least(0));
  }
};

}  // namespace gflow
