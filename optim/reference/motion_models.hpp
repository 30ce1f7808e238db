// SPDX-License-Identifier: Apache-2.0
// Forward functions of all motion models in double: Gaussian i of given parameters at a time.
#pragma once
#include <fmt/format.h>

#include <functional>

#include "optim/motion/keys.hpp"
#include "optim/motion/models.hpp"
#include "optim/reference/hexplane.hpp"
#include "optim/reference/nodes.hpp"
#include "optim/reference/spacetime.hpp"
#include "runtime/base/error.hpp"
#include "shared/motion/bases.h"

namespace gflow::reference {

using DoubleForward = std::function<Shifted(const Named&, size_t i, double t)>;

inline Canonical canonical_row(const Named& p, size_t i) {
  Canonical g;
  g.mean = row3(p.at("means"), i);
  g.mean_t = p.at("means_t")[i];
  g.quat = row4(p.at("quats"), i);
  g.log_scales = row4(p.at("log_scales"), i);
  g.logit_opacity = p.at("logit_opacities")[i];
  return g;
}

inline Spacetime spacetime_row(const Named& p, size_t i) {
  const Canonical s = canonical_row(p, i);
  return {s.mean,
          s.mean_t,
          row3(p.at("velocities"), i),
          row3(p.at("half_accelerations"), i),
          s.quat,
          row4(p.at("turns"), i),
          s.log_scales,
          s.logit_opacity};
}

inline Shifted keyframes_at(const MotionShape& shape, const Named& p, size_t i, double t) {
  const size_t n = p.at("means_t").size();
  const KeyWeights keys = key_weights(t, double(shape.duration), shape.keys);
  Shift d{{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}};
  for (int k = 0; k < keys.count; ++k) {
    const double w = double(keys.weight[k]);
    const size_t row = size_t(keys.first + k) * n + i;
    d.mean = d.mean + row3(p.at("key_shifts"), row) * w;
    d.quat = d.quat + row4(p.at("key_turns"), row) * w;
    if (shape.key_scales) d.log_scales = d.log_scales + row3(p.at("key_scales"), row) * w;
  }
  return shifted_at(canonical_row(p, i), d, t);
}

inline BasisPose basis_pose_at(const MotionShape& shape, const Named& p, int b, double t) {
  const KeyWeights keys = key_weights(t, double(shape.duration), shape.keys);
  BasisPose pose{{1, 0, 0, 0}, {0, 0, 0}, row3(p.at("pivots"), size_t(b))};
  for (int k = 0; k < keys.count; ++k) {
    const size_t row = size_t(keys.first + k) * size_t(shape.bases) + size_t(b);
    const double w = double(keys.weight[k]);
    pose.shift = pose.shift + row3(p.at("basis_shifts"), row) * w;
    pose.quat = pose.quat + row4(p.at("basis_turns"), row) * w;
  }
  pose.quat = quat_normalize(pose.quat).q;
  return pose;
}

inline Shifted bases_at(const MotionShape& shape, const Named& p, size_t i, double t) {
  const Canonical canonical = canonical_row(p, i);
  double weights[MAX_BASES];
  basis_weights(shape.bases, &p.at("basis_logits")[i * size_t(shape.bases)], weights);
  real3 shift{0, 0, 0};
  real4 turn{0, 0, 0, 0};
  for (int b = 0; b < shape.bases; ++b) {
    const BasisPose pose = basis_pose_at(shape, p, b, t);
    shift = shift + basis_shift(pose, canonical.mean) * weights[b];
    turn = turn + basis_turn(pose) * weights[b];
  }
  return shifted_at(blended(canonical, shift, turn), {{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}}, t);
}

inline Shifted hexplane_at(const MotionShape& shape, const Named& p, size_t i, double t) {
  const Canonical g = canonical_row(p, i);
  return shifted_at(g, hexplane_shift(shape.hexplane, double(shape.duration), p, g.mean, t), t);
}

// The forward function of one of gflow's own models; it throws Error for others.
inline DoubleForward forward_of(const MotionShape& shape) {
  return [shape](const Named& p, size_t i, double t) -> Shifted {
    switch (shape.motion) {
      case MotionModelKind::spacetime: {
        const SpacetimeSlice c = spacetime_at(spacetime_row(p, i), t);
        return {c.mean, c.factor, c.life};
      }
      case MotionModelKind::native4d: {
        const Slice c = slice_at(native4d_row(p, i), t);
        return {c.mean, c.factor, c.life};
      }
      case MotionModelKind::keyframes:
        return keyframes_at(shape, p, i, t);
      case MotionModelKind::bases:
        return bases_at(shape, p, i, t);
      case MotionModelKind::hexplane:
        return hexplane_at(shape, p, i, t);
      case MotionModelKind::nodes:
        return shifted_at(followed(shape, p, canonical_row(p, i), t),
                          {{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}}, t);
      default:
        throw Error(fmt::format("motion model {} has no reference in double precision",
                                name_of(shape.motion)));
    }
  };
}

}  // namespace gflow::reference
