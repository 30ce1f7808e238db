// SPDX-License-Identifier: Apache-2.0
// How good a model is on pictures it was not trained on: PSNR, SSIM, flow error, whole and where
// things move, depth, flicker, and what networks say.
#pragma once
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "optim/eval/track_error.hpp"
#include "optim/model/renderer.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

constexpr double kNoFigure = std::numeric_limits<double>::quiet_NaN();

// One view. NaN (null in JSON) where a figure has no meaning: no pixel moves, no flow or depth is
// known, no network is given.
struct ViewMetrics {
  std::string name;
  int step = 0;  // of the video
  double psnr = kNoFigure, ssim = kNoFigure;
  double psnr_dynamic = kNoFigure;      // over pixels whose reference flow exceeds 1 px
  double ssim_dynamic = kNoFigure;      // mean of the SSIM at these pixels
  double flow_epe = kNoFigure;          // [px] over pixels where the reference is known
  double flow_epe_dynamic = kNoFigure;  // and exceeds 1 px
  double fl_all = kNoFigure;  // [0, 1] share of known pixels off by > 3 px and > 5 % (KITTI)
  double teacher_epe_dynamic = kNoFigure;  // error of DIS on the same pixels, where both are there
  double depth_error = kNoFigure;          // relative, where the scene has true depth (metrics.hpp)
  double flicker = kNoFigure;  // [grey levels] from this view to its track's next (metrics.hpp)
  double lpips = kNoFigure;    // distance, where metrics.lpips names a network
  double clip = kNoFigure;     // similarity in [-1, 1], where metrics.clip names one
};

// The figures in the order of results.json, by name.
struct NamedFigure {
  const char* name;
  double ViewMetrics::*value;
};
const std::vector<NamedFigure>& view_figures();

struct Evaluation {
  ViewMetrics mean;            // over the views that have the figure
  std::string flow_reference;  // "true", "dis" or "none"
  bool trained_on = false;     // each view shows a picture of the training split
  std::vector<ViewMetrics> views;
  std::optional<TrackError> tracks;     // where the scene has true tracks
  std::string lpips_model, clip_model;  // the networks that judged; empty: none was given
};

// Judges `frames` (of scene.test, say). The reference flow is the scene's own where it has one,
// else, with flow.enabled, DIS between the frame and its track's next one in `frames`, where
// consistent; a camera that moved in between is part of it. DIS takes long: of many views about
// thirty, evenly spread, get it, and what training computed is read from `flow_folder`
// (FlowBetween). Flicker takes the same flow, and that its track's next view is in `frames` where
// it leads. What is not there costs nothing: true depth, the networks of config.metrics; Error
// where one of these cannot be used. `progress` may be empty. Does not set `tracks`. What is drawn
// is written as FOLDER/NAME.png unless `folder`, which must exist, is empty.
Evaluation evaluate(Queue& queue, Model& model, const TrainOptions& config,
                    const LoadedScene& loaded, const std::vector<Frame>& frames,
                    const ProgressCallback& progress, const std::string& folder = "",
                    const std::string& flow_folder = "");

}  // namespace gflow
