// SPDX-License-Identifier: Apache-2.0
// How good a model is: on a scene's views, and on its true paths.
#pragma once
#include <string>
#include <vector>

#include "optim/runs/run_state.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// The views, and the paths in space where the scene has true ones. What is drawn goes into the
// folder `pictures` unless that is empty; flow: the folder of what was computed.
Evaluation evaluate_views(Queue& queue, Model& model, const TrainOptions& config,
                          const LoadedScene& loaded, const std::vector<Frame>& frames, bool quiet,
                          const std::string& pictures, const std::string& flow);

// What the result will be judged by, once: better told now than at the end.
void require_metric_networks(const TrainOptions& config, const Scene& scene,
                             const FrameStore& frames);

// compare.png: the middle one of the views, beside its truth.
void write_comparison(Queue& queue, Model& model, const TrainOptions& config,
                      const LoadedScene& loaded, const RunFolder& run);

// Of a model of a run, on its scene's test views (or "train", "val").
struct RunEvaluation {
  Evaluation evaluation;
  std::string state;  // RunState::text of the model
  // Paths of the results; none beside a training, which will write them.
  std::vector<std::string> written;
};
// iteration: as for read_run_state. Of another than the latest only the results are written, under
// names of their own. settings: "metrics.key=value" that are others than the run's; the run keeps
// its own. Networks that judged results.json judge again where neither says anything.
RunEvaluation evaluate_run(Queue& queue, const RunFolder& run, const std::string& split, bool quiet,
                           int iteration = latest_iteration,
                           const std::vector<std::string>& settings = {});

}  // namespace gflow
