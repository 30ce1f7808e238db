// SPDX-License-Identifier: Apache-2.0
// Which Gaussians a training has: density control, who rests, and the order of their rows. Where
// memory runs out, training goes on with those there are.
#pragma once
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "optim/density/density.hpp"
#include "optim/density/order.hpp"
#include "optim/density/rest.hpp"
#include "optim/model/renderer.hpp"
#include "optim/train/sequential.hpp"

namespace gflow {

class Population {
 public:
  // All references must outlive it.
  Population(Queue& queue, const TrainOptions& config, const Scene& scene, Model& model);

  // Whether after_step() needs Gaussians that are outside the picture.
  bool needs_all_posed() const { return density_ && density_->needs_all_posed(); }
  // After the gradients of a view, which is a part of a picture width x height.
  void see(Queue& queue, const Renderer& renderer, const Shot& shot, int width, int height);
  // Adds what density control wants of the parameters to their gradients; before Adam.
  void add_gradients(Queue& queue);
  // After Adam of training step `step`, from 0, whose last view is in `renderer`; position_rate: of
  // the means. Whether the rows are others now.
  bool after_step(Queue& queue, const Renderer& renderer, const Stage& now, int step,
                  float position_rate);
  // Rows in the order of time and place. Whether they are others now.
  bool put_in_order(Queue& queue);

  // A sentence for the user about memory that is short since the last call, or "".
  std::string take_notice() { return std::exchange(notice_, ""); }

  // What lives from step to step, beside the parameters.
  void save_state(Queue& queue, Arrays& arrays) const;
  // The reverse. Error when the arrays are missing or do not fit; `path`: the file, for messages.
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path);

 private:
  bool refining(int done) const;
  bool refine(Queue& queue, uint32_t seed);
  bool settling(int done) const;
  bool settle(Queue& queue);
  void memory_is_short(const std::string& sentence);

  const TrainOptions& config_;
  const Scene& scene_;
  Model& model_;
  std::unique_ptr<Density> density_;  // nullptr: their number stays
  DensityRule density_rule_;
  RowOrder order_;
  std::unique_ptr<Rest> rest_;                                // nullptr: all move
  size_t memory_holds_ = std::numeric_limits<size_t>::max();  // Gaussians
  bool memory_was_short_ = false;
  std::string notice_;
};

}  // namespace gflow
