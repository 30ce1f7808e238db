// SPDX-License-Identifier: Apache-2.0
// Evaluation of a model on views it was not trained on: PSNR, SSIM, flow error, in the whole image
// and at moving pixels, depth error, flicker, and metrics by networks.
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

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

// Metrics of one view. NaN (null in JSON) if a metric is undefined: no pixel moves, flow or depth
// is unknown, no network is given.
struct ViewMetrics {
  std::string name;
  int step = 0;     // time step of the video
  double time = 0;  // [0, 1]
  double psnr = kNotMeasured, ssim = kNotMeasured;
  double psnr_matched = kNotMeasured;   // PSNR of color_matched() (metrics.hpp)
  double psnr_unfitted = kNotMeasured;  // before the camera was fitted (Evaluation::fitted_cameras)
  // Over pixels whose reference flow exceeds 1 px; SSIM: the mean at these pixels.
  double psnr_dynamic = kNotMeasured, ssim_dynamic = kNotMeasured;
  double flow_epe = kNotMeasured;          // [px] over pixels with known reference flow
  double flow_epe_dynamic = kNotMeasured;  // [px] over pixels whose reference flow exceeds 1 px
  // Share, in [0, 1], of known pixels off by > 3 px and > 5 % (KITTI).
  double fl_all = kNotMeasured;
  // [px] error of DIS over the pixels of flow_epe_dynamic, if both exist.
  double teacher_epe_dynamic = kNotMeasured;
  double depth_error = kNotMeasured;  // relative, if the scene has true depth (metrics.hpp)
  // [grey levels] to the next view of its camera track (metrics.hpp).
  double flicker = kNotMeasured;
  double lpips = kNotMeasured;  // distance, if metrics.lpips names a network
  double clip = kNotMeasured;   // similarity in [-1, 1], if metrics.clip names a network
};

// The metrics by name, in the order of results.json.
struct NamedMetric {
  const char* name;
  double ViewMetrics::*value;
};
const std::vector<NamedMetric>& view_metrics();

struct Evaluation {
  ViewMetrics mean;             // over the views in which the metric is finite
  std::string flow_reference;   // "true", "dis" or "none"
  bool fitted_cameras = false;  // cameras of the views were fitted to their images
  bool trained_on = false;      // each view shows an image of the training split
  size_t gaussians = 0;         // of the model
  std::vector<ViewMetrics> views;
  std::optional<TrackError> tracks;     // if the scene has true tracks
  std::string lpips_model, clip_model;  // the networks used; empty: none
};

// Evaluates `frames` (such as scene.test). If training corrects the cameras (cameras.refine), those
// of frames that are not trained are fitted first (camera_fit.hpp), in loaded.frames. The reference
// flow is the scene's true flow if it has one; else, with flow.enabled or a camera that stands
// still, DIS between the frame and the next one of its camera track in `frames`, where consistent,
// including the motion of the camera. Of many views about thirty, evenly spread, use it; flow
// computed in training is read from `flow_folder` (FlowBetween). Flicker uses the same flow, and
// needs the next view of the track in `frames` at the target of the flow. True depth and the
// networks of config.metrics are optional; Error if one of them cannot be used. `progress` may be
// empty. Does not set `tracks`. Rendered images are written as FOLDER/NAME.png unless `folder`,
// which must exist, is empty.
Evaluation evaluate(Queue& queue, Model& model, const TrainOptions& config,
                    const LoadedScene& loaded, const std::vector<Frame>& frames,
                    const ProgressCallback& progress, const std::string& folder = "",
                    const std::string& flow_folder = "");

// Up to `most` of the frames, evenly over their order (cameras, then times).
std::vector<Frame> sample_of(const std::vector<Frame>& frames, size_t most);

}  // namespace gflow
