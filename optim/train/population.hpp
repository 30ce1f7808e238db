// SPDX-License-Identifier: Apache-2.0
// Number and order of Gaussians: density control, static/dynamic split, and row order. If memory
// runs out, training continues with the Gaussians that exist.
#pragma once
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "optim/density/density.hpp"
#include "optim/density/hidden.hpp"
#include "optim/density/near_fade.hpp"
#include "optim/density/order.hpp"
#include "optim/density/static_detection.hpp"
#include "optim/model/renderer.hpp"
#include "optim/train/sequential.hpp"

namespace gflow {

class Population {
 public:
  // All references must outlive it.
  Population(Queue& queue, const TrainOptions& config, const Scene& scene, Model& model);

  // Whether after_step() needs Gaussians outside the image.
  bool needs_all_posed() const { return density_ && density_->needs_all_posed(); }
  // After the gradients of a view, which may be a part of an image of width x height. some_ignored:
  // pixels of it take no part in the losses.
  void see(Queue& queue, const Renderer& renderer, const Shot& shot, int width, int height,
           bool some_ignored);
  // Before step `step`, from 0, in two rounds of a training with permanent Gaussians: makes those
  // that no view shows so faint that the round removes them (density.prune_hidden). Of more than
  // 200 views as many are drawn, and Gaussians outside all of these stay. Does nothing if memory
  // runs out. weigh: ViewPass::weigh() with `renderer`. Returns whether Gaussians may have changed.
  bool fade_hidden(Queue& queue, int step, const Renderer& renderer,
                   const std::function<void(const Frame&)>& weigh);
  // Adds the regularisers of density control to the gradients; before Adam.
  void add_gradients(Queue& queue);
  // After Adam of training step `step`, from 0, whose last view is in `renderer`; position_rate:
  // learning rate of the means. Returns whether rows have changed.
  bool after_step(Queue& queue, const Renderer& renderer, const Stage& now, int step,
                  float position_rate);
  // Sorts rows by time and place. Returns whether rows have changed.
  bool put_in_order(Queue& queue);

  // Message to the user if memory became short since the last call, else "".
  std::string take_notice() { return std::exchange(notice_, ""); }

  // State for a checkpoint, besides the parameters.
  void save_state(Queue& queue, Arrays& arrays) const;
  // The reverse. Error if the arrays are missing or do not fit; `path`: the file, for messages.
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path);

 private:
  bool refining(int done) const;
  bool seeks_hidden(int done) const;
  bool refine(Queue& queue, uint32_t seed);
  bool settling(int done) const;
  bool settle(Queue& queue);
  // Fades what is before the near planes of the cameras of a random time step.
  void fade_near(Queue& queue, uint32_t random);
  void memory_is_short(const std::string& sentence);

  const TrainOptions& config_;
  const Scene& scene_;
  Model& model_;
  std::unique_ptr<Density> density_;  // nullptr: the number is constant
  DensityRule density_rule_;
  NearFade near_fade_;
  Hidden hidden_;
  RowOrder order_;
  std::unique_ptr<StaticDetection> static_detection_;         // nullptr: all are dynamic
  size_t memory_holds_ = std::numeric_limits<size_t>::max();  // limit on the number of Gaussians
  bool memory_was_short_ = false;
  std::string notice_;
};

}  // namespace gflow
