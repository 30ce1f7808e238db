// SPDX-License-Identifier: Apache-2.0
// A motion model: parameters to Gaussians at a time, and gradients back. Everything else sees this
// interface only. Times are in the model's own unit: the video is [0, duration].
#pragma once
#include <cmath>

#include "optim/engine/gaussians.hpp"
#include "optim/motion/hexplane_shape.hpp"
#include "optim/motion/view_rows.hpp"

namespace gflow {

// Standard deviations in time from a Gaussian's own moment to where its temporal weight has fallen
// to the cutoff, which is in [0, 1).
inline float window_sigmas(float cutoff) { return std::sqrt(-2 * std::log(cutoff)); }

// How one Gaussian becomes two.
struct SplitRule {
  float split_scale = 0;   // larger ones are split, smaller ones cloned [scene units]
  float split_travel = 1;  // one that moves further than this x its size is split in time
  float min_lifetime = 0;  // but not to a temporal scale below this [model time]
  float duration = 1;      // length of the video [model time]
};

// How fast each Gaussian learns: (duration / time it is seen)^power, in [1, most].
struct PaceRule {
  float duration = 1;   // length of the video [model time]
  float time_step = 1;  // duration / steps of the video [model time]
  float power = 1, most = 8;
  static constexpr float kMost = 1000;  // that `most` may be
};

// Groups that every model has, and density control reads: means [N,3], means_t [N,1] (a Gaussian's
// own moment), log_scales [N,4] (x y z and its life), logit_opacities [N,1].
class Motion {
 public:
  virtual ~Motion() = default;

  // The arrays this model trains with a row a Gaussian, beside colour; and those with other rows.
  virtual std::vector<GroupSpec> groups() const = 0;
  virtual std::vector<TableSpec> tables() const { return {}; }

  // Gaussians at time t, an entry for each of `rows`. With seen = nullptr (the time that is drawn)
  // those outside their time window have opacity 0 and are else undefined. Otherwise t is the
  // second time of a flow: entries with (*seen)[k] > 0 are set, in their window or not, but for
  // their opacities, which nobody needs then; the others are undefined.
  virtual void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
                  GaussiansAt& gaussians, const RowList& rows = {}) = 0;

  // Marks in `rows` whom a camera may see at the time that is drawn: all that it draws, and little
  // else. false: this model does not look, and is only given lists of all rows.
  virtual bool look(Queue&, const Parameters&, float /*t*/, const PinholeCamera&, ViewRows&) {
    return false;
  }

  // Gradients of the last loss by the parameters, from those by the Gaussians at time t, for the
  // entries of `rows` with tiles_touched > 0. `first`: t is the time drawn; marks the rows as seen
  // in this training step and starts their gradients. Otherwise t is the second time: adds. Rows of
  // other tables start when they are first seen in a step, and their range joins the table's
  // `active`.
  virtual void backward(Queue& queue, Parameters& parameters, float t, bool first,
                        const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                        const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                        const RowList& rows = {}) = 0;

  // After all backward() of a training step: adds the gradients of what keeps the model simple.
  virtual void regularize(Queue&, Parameters&, const HexplaneOptions&) {}

  // Sets parameters.rows.pace and reach, by which Adam's rates become those of each Gaussian.
  virtual void set_pace(Queue& queue, Parameters& parameters, const PaceRule& rule) = 0;

  // Before a key is trained alone: it goes on from the two before it at the same velocity. Error
  // for models without keys of each Gaussian.
  virtual void start_key(Queue&, Parameters&, int /*key*/) {
    throw Error("this motion model has no keys of each Gaussian to start: use keyframes");
  }

  // Makes two different Gaussians of two equal rows: child [N] is 1 or 2 for such rows, 0 for the
  // others. Repeatable for a seed.
  virtual void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
                     const SplitRule& rule, uint32_t seed) = 0;
};

}  // namespace gflow
