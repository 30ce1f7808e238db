// SPDX-License-Identifier: Apache-2.0
// The motion models by name, and what of their parameters is made or asked on the host. A new model
// is one more word here, beside its own four files.
#pragma once
#include <array>
#include <map>
#include <memory>

#include "optim/motion/motion.hpp"

namespace gflow {

enum class MotionModelKind { spacetime, native4d };
constexpr std::array<const char*, 2> names_of(MotionModelKind) { return {"spacetime", "native4d"}; }

// cutoff: temporal weight, in [0, 1), at or below which a Gaussian is skipped.
std::unique_ptr<Motion> make_motion(Queue& queue, MotionModelKind kind, float cutoff);

// Parameter arrays on the host by group name, a row a Gaussian.
using HostGroups = std::map<std::string, std::vector<float>>;

// A group that only this model has, and the properties of a PLY that hold its columns.
struct MotionColumns {
  std::string group;
  std::vector<std::string> properties;
};
std::vector<MotionColumns> motion_columns(MotionModelKind kind);

// Fills those groups for `count` Gaussians that stand still, turned as "quats" says.
void add_rest(MotionModelKind kind, HostGroups& groups, size_t count);

// Gives Gaussian i, at rest, not turned, of spatial scale s and temporal scale s_t, the velocity v;
// native4d: or the largest along v that those scales allow.
void set_velocity(MotionModelKind kind, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t);

// Whether no Gaussian moves.
bool at_rest(MotionModelKind kind, const HostGroups& groups);

}  // namespace gflow
