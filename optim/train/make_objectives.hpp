// SPDX-License-Identifier: Apache-2.0
// The objectives of a training run: gflow's own, registered in one table, and those of the caller.
#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "optim/flow/flow_store.hpp"
#include "optim/guidance/guidance.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

// Inputs of a training run. All references must outlive it.
struct TrainInputs {
  Queue& queue;
  const TrainOptions& options;
  const Scene& scene;
  FrameStore& frames;
  const std::vector<FlowPair>& pairs;  // may be empty
  FlowStore& flows;                    // flows[i] belongs to pairs[i]
  Model& model;
  Guidance* guidance = nullptr;  // the provider of options.guidance; nullptr: none
};

// Makes an objective; nullptr if the options leave it nothing to do.
using MakeObjective = std::function<std::unique_ptr<Objective>(const TrainInputs&)>;

// gflow's objectives in their order, then `more`.
std::vector<std::unique_ptr<Objective>> make_objectives(const TrainInputs& inputs,
                                                        const std::vector<MakeObjective>& more);

}  // namespace gflow
