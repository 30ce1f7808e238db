// SPDX-License-Identifier: Apache-2.0
// Applies the gradients of a step: regularisers of the model, Adam with its learning rates, density
// control.
#pragma once
#include <memory>

#include "optim/train/learning_rates.hpp"
#include "optim/train/population.hpp"

namespace gflow {

class Optimizer {
 public:
  // The references must outlive it.
  Optimizer(Queue& queue, const TrainOptions& options, const Scene& scene, Model& model);

  // Before the gradients of a step: zeroes them. With train.sequential, starts the key of a new
  // time step.
  void begin_step(Queue& queue, const Stage& stage);
  // Applies the gradients. renderer: in its state after the last view. warming: motion is not
  // trained yet. sh_degree: highest band in use. Returns whether the rows of the model have
  // changed.
  bool step(Queue& queue, const Renderer& renderer, const Stage& stage, int step, bool warming,
            int sh_degree);

  Population& population() { return population_; }
  Rates& rates() { return rates_; }
  const Rates& rates() const { return rates_; }

 private:
  void update(Queue& queue, const Stage& stage, int step, bool warming, int sh_degree);

  const TrainOptions& options_;
  const Scene& scene_;
  Model& model_;
  Rates rates_;
  Adam adam_;                        // for the Gaussians' table
  std::unique_ptr<Adam> path_adam_;  // for keys, bases, planes and networks; nullptr: none
  Population population_;
};

}  // namespace gflow
