// SPDX-License-Identifier: Apache-2.0
// Poses of a model at some times, for viewers that do not evaluate its motion model.
#pragma once
#include <vector>

#include "optim/model/model.hpp"

namespace gflow {

// Poses of the first `moving` Gaussians, the dynamic ones. Between two times a viewer interpolates
// linearly, quaternions followed by a normalisation: scales keep their order and quaternions their
// sign from one time to the next.
struct BakedPoses {
  std::vector<double> times;      // scene times, ascending
  size_t moving = 0;              // M
  std::vector<float> means;       // [times, M, 3]
  std::vector<float> quats;       // [times, M, 4] unit, w x y z
  std::vector<float> log_scales;  // [times, M, 3]; empty if they are those of the model
  // [times, N] of all Gaussians; empty if they follow from means_t, lifetime and logit as in
  // kernels/shared/motion/life.h, which is so in all of gflow's own models.
  std::vector<float> opacities;
};

// Whether a viewer needs poses: the model moves, and not as spacetime, native4d or keyframes.
bool needs_poses(const HostModel& model);

// A pose takes 28 bytes or, if scales change, 40: the times that keep all within `most` bytes,
// evenly chosen from first to last, at least two.
std::vector<double> times_within(const std::vector<double>& times, size_t moving, size_t most);

BakedPoses bake_poses(Queue& queue, const HostModel& model, const std::vector<double>& times);

// Every k-th of the times and the last one, for the largest k with which 95 % of the poses left out
// are those between their neighbours, within `tolerance`: in means relative to the longest scale,
// in radians, log scales and opacities. Gaussians of which first and last time say all do not
// count.
BakedPoses thinned(const BakedPoses& poses, const HostModel& model, double tolerance);

// Rotation and scales of a Gaussian from the factor of its covariance.
struct FactorPose {
  std::array<double, 4> quat;  // unit, w x y z
  std::array<double, 3> scales;
};

// The pose of a factor L [3, 3], row by row. If L has orthogonal columns, as in models with scales
// and a rotation, these are the axes; otherwise the axes of L L^T. `before`: the pose at the time
// before, which axes and sign follow; nullptr: none.
FactorPose pose_of_factor(const float* factor, const FactorPose* before);

}  // namespace gflow
