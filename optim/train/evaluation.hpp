// SPDX-License-Identifier: Apache-2.0
// How good a model is on pictures it was not trained on: PSNR, SSIM, flow error, whole and where
// things move.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "optim/data/report.hpp"
#include "optim/train/loaded_scene.hpp"
#include "optim/train/renderer.hpp"
#include "optim/train/track_error.hpp"

namespace gflow {

// One view. NaN (null in JSON) where a figure has no meaning: no pixel moves, no flow is known.
struct ViewFigures {
  std::string name;
  double psnr = 0, ssim = 0;
  double psnr_dynamic = 0;         // over pixels whose reference flow exceeds 1 px
  double flow_epe = 0;             // [px] over pixels where the reference is known
  double flow_epe_dynamic = 0;     // and exceeds 1 px
  double teacher_epe_dynamic = 0;  // error of DIS on the same pixels, where both are there
};

struct Evaluation {
  ViewFigures mean;            // over the views that have the figure
  std::string flow_reference;  // "true", "dis" or "none"
  bool trained_on = false;     // each view shows a picture of the training split
  std::vector<ViewFigures> views;
  std::optional<TrackError> tracks;  // where the scene has true tracks
};

// Judges `frames` (of scene.test, say). The reference flow is the scene's own where it has one,
// else, with flow.enabled, DIS between the frame and its track's next one in `frames`, where
// consistent; a camera that moved in between is part of it. DIS takes long: of many views about
// thirty, evenly spread, get it, and what training computed is read from `flow_folder`
// (FlowBetween). `progress` may be empty. Does not set `tracks`. What is drawn is written as
// FOLDER/NAME.png unless `folder`, which must exist, is empty.
Evaluation evaluate(Queue& queue, Model& model, const TrainConfig& config,
                    const LoadedScene& loaded, const std::vector<Frame>& frames,
                    const ProgressCallback& progress, const std::string& folder = "",
                    const std::string& flow_folder = "");

}  // namespace gflow
