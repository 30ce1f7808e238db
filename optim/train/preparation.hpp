// SPDX-License-Identifier: Apache-2.0
// What a training needs before its first step: pictures, flow, parts of interest, first Gaussians.
#pragma once
#include <optional>

#include "optim/scene/loaded_scene.hpp"
#include "optim/train/trainer.hpp"

namespace gflow {

class Preparation {
 public:
  // Reads the scene and finds out which pictures have flow between them. Error when the scene is
  // broken, has no training views or not those that train.sequential needs, and when flow is to be
  // read and is not there. The configuration must outlive it.
  Preparation(const TrainOptions& config, const std::string& unpack_folder);
  // The same of a scene that is loaded.
  Preparation(const TrainOptions& config, LoadedScene loaded);
  Preparation(const Preparation&) = delete;  // scene and flows are referred to

  // Whether flow is still to be computed.
  bool lacks_flow() const { return !flows_; }
  // How many of flows(), the first, are read from files one by one.
  size_t flows_in_files() const {
    return config_.flow.enabled && config_.flow.source == FlowSource::files ? neighbours_.size()
                                                                            : 0;
  }
  // Computes it, kept in a folder: beforehand where all fits into its room and training is long
  // enough to look at all pairs, else when it is asked for. Nothing where there is flow.
  void compute_flow(const std::string& folder, bool quiet);
  // Finds what moves in the pictures, for focus and first Gaussians. Needs no flow. Error when
  // init.from asks for stereo points and there are none.
  void find_motion_masks();

  // As many Gaussians at most as density.cap and the memory allow. A scene without points gets
  // those of several cameras (stereo_points.hpp).
  HostModel first_model(Queue& queue);
  // Whether that began with points several cameras agree on.
  bool began_with_stereo() const { return began_with_stereo_; }
  // guidance: of the settings, or nullptr; it must outlive the trainer. more: further objectives.
  Trainer trainer(Queue& queue, Model& model, Guidance* guidance = nullptr,
                  const std::vector<MakeObjective>& more = {});

  const LoadedScene& loaded() const { return loaded_; }
  const Scene& scene() const { return loaded_.scene; }
  FrameStore& frames() { return *loaded_.frames; }
  FlowStore& flows() { return *flows_; }

 private:
  PointCloud points_from_stereo();

  const TrainOptions& config_;
  LoadedScene loaded_;
  std::vector<FlowPair> neighbours_;  // both ways
  std::vector<FlowPair> pairs_;       // these and those further apart
  std::optional<FlowStore> flows_;
  std::vector<StaticCamera> static_cameras_;
  std::vector<Rect> parts_;
  bool began_with_stereo_ = false;
};

}  // namespace gflow
