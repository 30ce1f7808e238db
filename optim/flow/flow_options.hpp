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
    field("enabled", self.enabled, "supervise the motion with optical flow");
    field("weight", self.weight, "of the flow loss beside the image loss (the paper: 0.5)",
          at_least(0));
    field("source", self.source,
          "dis: computed from the pictures; files: read from the folder; tracks: of points only");
    field("folder", self.folder,
          "flow files <camera>/<step>.flo, .flo.gz, .png, .npy, or <picture>.flo ...; empty: the "
          "scene's own true flow");
    field(
        "pairs", self.pairs,
        "which pictures are compared: track, neighbours from one camera, at rest or moving; time, "
        "each and the next in time, whoever took it (source files)");
    field("span", self.span,
          "longest flow [pictures]: 1, between neighbours; 8, also over 2, 4 and 8; 0: up to the "
          "whole track",
          at_least(0));
    field(
        "long_span", self.long_span,
        "flow over several pictures: chain, of that between neighbours; direct, computed; tracks");
    field("long_share", self.long_share,
          advanced("share of the steps with flow that compare pictures further apart"),
          between(0, 1));
    field("tracks", self.tracks,
          "paths of points: a folder with <camera>.npz, or the one file; optim/flow/README.md");
    field("transport", self.transport, "how a pixel moves with a Gaussian");
    field("top_k", self.top_k,
          advanced("Gaussians that count for the flow of a pixel, in depth order; 0: all"),
          at_least(0));
    field("stop", self.stop,
          advanced("whether the Gaussian that makes a pixel opaque still counts"));
    field("detach_t1", self.detach_t1,
          advanced("let the flow loss move the Gaussians at the later time only"));
    field("detach_weights", self.detach_weights,
          advanced("let the flow loss change how Gaussians move, not what they cover"));
    field("robust_px", self.robust_px,
          advanced("knee of the robust norm: quadratic below, linear above [px]"), above(0));
    field(
        "every", self.every,
        advanced(
            "the flow loss counts in every n-th step only, n times as much; 0: 2 for spacetime and "
            "native4d, else 1"),
        at_least(0));
    field("low_motion", self.low_motion,
          advanced("probability with which a tile of 16x16 pixels where the flow to learn is 0 "
                   "counts in a "
                   "step, then 1/probability times as much; 1: all tiles in every step; 0: 0.1 for "
                   "spacetime "
                   "and native4d, else 1"),
          between(0, 1));
    field("low_motion_px", self.low_motion_px,
          advanced("flow (times its confidence) from which a tile counts in every step; below, the "
                   "probability is in proportion, at least flow.low_motion [px]"),
          above(0));
    field("start", self.start, "first step with the flow loss", at_least(0));
    field("max_gap", self.max_gap,
          advanced("frames further apart than this are not compared [time steps]"), at_least(1));
    field("confidence", self.confidence, "drop flow that fails the forward-backward check");
    field("backward", self.backward, "also compare with the frame before (source dis)");
    field("store", self.store,
          "room on disk for computed flow [GiB]; where all would fit, at a byte a pixel, it is "
          "computed beforehand, else when needed, and what was unused for longest is dropped",
          at_least(0));
  }
};

}  // namespace gflow
