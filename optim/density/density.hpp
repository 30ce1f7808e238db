// SPDX-License-Identifier: Apache-2.0
// Density control: adds, moves and removes Gaussians. The strategies by name, and the interface
// through which training uses them. A new strategy needs its own files and one more name here.
#pragma once
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "optim/density/density_options.hpp"
#include "optim/engine/gaussians.hpp"
#include "optim/formats/npz.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

// Lengths in scene units, times in model time; the cap is never 0. Each strategy reads what it
// needs.
struct DensityRule : DensityOptions {
  float cutoff = 0.05f;  // Gaussians below this temporal weight at all times are removed
  SplitRule split;       // how one Gaussian becomes two; the length of the video
  bool wakes = true;     // children of static Gaussians are dynamic
};

inline float logit(float p) { return std::log(p / (1 - p)); }

// Result of one view.
struct DensityView {
  int width, height;                     // of the whole image
  RowList rows;                          // rows that the arrays below have entries for
  const Buffer<cl_uint>& tiles_touched;  // [n]
  const Buffer<float>& v_means2d;        // [n, 2] [1/px]
  bool some_ignored = false;             // pixels take no part in the losses
};

// The last training step.
struct DensityStep {
  int done;             // steps made
  bool refining;        // density control has not stopped yet
  float position_rate;  // learning rate of the means
  uint32_t seed;        // random seed of this step
};

class Density {
 public:
  virtual ~Density() = default;

  // After the gradients of a view.
  virtual void see(Queue&, const Parameters&, const DensityView&) {}
  // Adds the strategy's regularisers to the gradients; before Adam.
  virtual void add_gradients(Queue&, Parameters&, const DensityRule&) {}
  // Whether after_step() needs Gaussians of `drawn` that are outside the image.
  virtual bool needs_all_posed() const { return false; }
  // After Adam. `drawn`: the Gaussians of the step's last view.
  virtual void after_step(Queue&, Parameters&, const GaussiansAt& drawn, const DensityRule&,
                          const DensityStep&) {
    (void)drawn;
  }
  // A round: rebuilds all arrays of `parameters`. Repeatable for a seed. If memory runs out it
  // throws (is_out_of_memory) and `parameters` are unchanged.
  virtual void refine(Queue&, Parameters&, Motion&, const DensityRule&, uint32_t seed) = 0;

  // After other code has moved the rows: new row i was row source[i].
  virtual void reorder(Queue&, const Buffer<cl_uint>& source) { (void)source; }

  // Adds the state that a checkpoint must hold.
  virtual void save_state(Queue&, Arrays&) const {}
  // The reverse. Error if the arrays are missing or do not fit; `path`: the file, for messages.
  virtual void load_state(Queue&, const Arrays&, const std::string& path) { (void)path; }
};

std::unique_ptr<Density> make_density(Queue& queue, DensityKind kind);

}  // namespace gflow
