// SPDX-License-Identifier: Apache-2.0
// Evaluation of a run's model: on a scene's views, and on true 3D tracks.
#pragma once
#include <string>
#include <vector>

#include "optim/runs/run_state.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// Evaluates the views, and the 3D tracks if the scene has true ones. Rendered images go into the
// folder `image_folder` unless it is empty; flow: folder of computed flow.
Evaluation evaluate_views(Queue& queue, Model& model, const TrainOptions& config,
                          const LoadedScene& loaded, const std::vector<Frame>& frames, bool quiet,
                          const std::string& image_folder, const std::string& flow);

// Loads the metric networks once before training, so that errors appear now and not at the end.
void require_metric_networks(const TrainOptions& config, const Scene& scene,
                             const FrameStore& frames);

// Writes compare.png: the middle one of the views beside its truth.
void write_comparison(Queue& queue, Model& model, const TrainOptions& config,
                      const LoadedScene& loaded, const std::vector<Frame>& frames,
                      const RunFolder& run);

// Evaluation of a run's model on its scene's test views (or "train", "val").
struct RunEvaluation {
  Evaluation evaluation;
  std::string state;  // RunState::text of the evaluated model
  RunFacts facts;     // of that model
  // Paths of the results; none while a training process holds the run, which will write them
  // itself.
  std::vector<std::string> written;
};
// iteration: as for read_run_state; for another than the latest only the results are written, under
// their own names. settings: "metrics.key=value", which override the run's settings for this call.
// Networks that evaluated results.json are used again unless `settings` or the run name others.
RunEvaluation evaluate_run(Queue& queue, const RunFolder& run, const std::string& split, bool quiet,
                           int iteration = latest_iteration,
                           const std::vector<std::string>& settings = {});

}  // namespace gflow
