// SPDX-License-Identifier: Apache-2.0
// Preparation before the first step: images, flow, focus regions, initial Gaussians.
#pragma once
#include <optional>

#include "optim/init/motion_mask.hpp"
#include "optim/movers/first_model.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "optim/train/trainer.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

class Preparation {
 public:
  // Reads the scene and finds the pairs of images that have flow. Error if the scene is broken, has
  // no training views or lacks those that train.sequential needs, and if flow files are requested
  // and missing. Warns of settings without effect.
  Preparation(const TrainOptions& config, const std::string& unpack_folder);
  // The same for a loaded scene.
  Preparation(const TrainOptions& config, LoadedScene loaded);
  Preparation(const Preparation&) = delete;  // other objects refer to scene and flows

  // Whether flow still has to be computed.
  bool lacks_flow() const { return !flows_; }
  // Number of flows, the first of flows(), that are read from single files.
  size_t flows_in_files() const {
    return config_.flow.enabled && config_.flow.source == FlowSource::files ? neighbours_.size()
                                                                            : 0;
  }
  // Computes flow and keeps it in a folder: beforehand if all of it fits into its budget and
  // training is long enough to use all pairs, else on demand. Does nothing if flow exists.
  // quiet: no progress line; progress: also called with the numbers of pairs done and of all, from
  // any thread, one call at a time.
  void compute_flow(const std::string& folder, bool quiet, const ProgressCallback& progress = {});
  // Finds motion masks, for focus regions and initial Gaussians. Needs no flow. Error if init.from
  // asks for stereo points and there are none.
  void find_motion_masks();

  // The initial model, with at most as many Gaussians as density.cap and memory allow. A scene
  // without points gets those of its depth files or stereo points. That of one moving camera gets
  // what rests and what moves (movers/first_model.hpp), and motion_masks(). quiet: no progress
  // lines.
  HostModel first_model(Queue& queue, bool quiet = true);
  // Of the scene of a moving camera: what moves in each training frame, which decides about focus
  // regions; else empty. A run that is resumed must set those it began with.
  const MotionMasks& motion_masks() const { return motion_masks_; }
  void set_motion_masks(MotionMasks masks);
  // Where the points of first_model's scene come from, in words.
  const char* place_of_points() const { return place_of_points_; }
  // guidance: provider of the settings, or nullptr; it must outlive the trainer. more: further
  // objectives.
  Trainer trainer(Queue& queue, Model& model, Guidance* guidance = nullptr,
                  const std::vector<MakeObjective>& more = {});

  // The settings, with_scene_defaults().
  const TrainOptions& config() const { return config_; }
  const LoadedScene& loaded() const { return loaded_; }
  const Scene& scene() const { return loaded_.scene; }
  FrameStore& frames() { return *loaded_.frames; }
  FlowStore& flows() { return *flows_; }

 private:
  std::optional<HostModel> model_of_moving_camera(Queue& queue, bool quiet);
  PointCloud points_from_depth();
  PointCloud points_from_stereo();

  LoadedScene loaded_;
  const TrainOptions config_;
  std::vector<FlowPair> neighbours_;  // pairs of neighbours, in both directions
  std::vector<FlowPair> pairs_;       // neighbours_ and pairs further apart
  std::optional<FlowStore> flows_;
  std::vector<StaticCamera> static_cameras_;
  std::vector<Rect> parts_;
  MotionMasks motion_masks_;
  const char* place_of_points_ = "at the scene's points";
};

}  // namespace gflow
