// SPDX-License-Identifier: Apache-2.0
// Interface of a motion model: parameters to Gaussians at a time, and the backward pass. All other
// code uses this interface only. Times are model times: the video is [0, duration].
#pragma once
#include <cmath>

#include "optim/engine/gaussians.hpp"
#include "optim/motion/view_rows.hpp"

namespace gflow {

struct MotionOptions;

// Half-width of a Gaussian's time window [standard deviations]: there its temporal weight equals
// the cutoff, which is in [0, 1).
inline float window_sigmas(float cutoff) { return std::sqrt(-2 * std::log(cutoff)); }

// How density control turns one Gaussian into two.
struct SplitRule {
  float split_scale = 0;   // larger Gaussians are split, smaller ones cloned [scene units]
  float split_travel = 1;  // Gaussians that move further than this are split in time [x their size]
  float min_lifetime = 0;  // shortest temporal scale that a split in time makes [model time]
  float duration = 1;      // length of the video [model time]
};

// Learning-rate factor per Gaussian: (duration / time it is visible)^power, in [1, most].
struct PaceRule {
  float duration = 1;   // length of the video [model time]
  float time_step = 1;  // duration / time steps of the video [model time]
  float power = 1, most = 8;
  static constexpr float kMost = 1000;  // upper bound of `most`
};

// Groups that every model has and density control reads: means [N,3], means_t [N,1] (temporal
// mean), log_scales [N,4] (x y z and lifetime), logit_opacities [N,1].
class Motion {
 public:
  virtual ~Motion() = default;

  // Groups with a row per Gaussian, besides colour; and tables with other rows.
  virtual std::vector<GroupSpec> groups() const = 0;
  virtual std::vector<TableSpec> tables() const { return {}; }

  // Sets the Gaussians at time t, one entry per entry of `rows`. seen = nullptr: t is the rendered
  // time; Gaussians outside their time window get opacity 0 and are otherwise undefined. Else t is
  // the second time of a flow: entries with (*seen)[k] > 0 are set inside and outside their window,
  // except for opacities, which flow does not need; the others are undefined.
  virtual void at(Queue& queue, const Parameters& parameters, float t, const Buffer<cl_uint>* seen,
                  GaussiansAt& gaussians, const RowList& rows = {}) = 0;

  // Culling: marks in `rows` the Gaussians that the camera may see at the rendered time; all that
  // it renders, and few others. Returns false if the model does not cull; it then gets lists of all
  // rows only.
  virtual bool cull(Queue&, const Parameters&, float /*t*/, const PinholeCamera&, ViewRows&) {
    return false;
  }

  // Backward pass, after at() with these parameters: from the gradients of the loss by the
  // Gaussians at time t to those by the parameters, for the entries of `rows` with
  // tiles_touched > 0. `first`: t is the rendered time; marks the rows as seen in this training
  // step and starts their gradients. Otherwise t is the second time and gradients are added. Rows
  // of other tables start when they are first seen in a step, and their range joins the table's
  // `active`.
  virtual void backward(Queue& queue, Parameters& parameters, float t, bool first,
                        const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                        const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                        const RowList& rows = {}) = 0;

  // After all backward() of a training step: adds the gradients of the model's regularisers.
  virtual void regularize(Queue&, Parameters&, const MotionOptions&) {}

  // Sets parameters.rows.rate_scale and rate_divisor, which scale Adam's learning rates per row.
  virtual void set_rate_scales(Queue& queue, Parameters& parameters, const PaceRule& rule) = 0;

  // Before a key is trained alone: extrapolates it from the keys before it at constant velocity.
  // Error for models without keys per Gaussian.
  virtual void start_key(Queue&, Parameters&, int /*key*/) {
    throw Error("this motion model has no keys per Gaussian: use keyframes");
  }

  // Makes two different Gaussians of two equal rows. child [N]: 1 or 2 for such rows, 0 for the
  // others. Repeatable for a seed.
  virtual void split(Queue& queue, Parameters& parameters, const Buffer<cl_uint>& child,
                     const SplitRule& rule, uint32_t seed) = 0;

  // Now and then after density control: moves rows that all Gaussians share to where they are
  // needed.
  virtual void rearrange(Queue&, Parameters&) {}
};

}  // namespace gflow
