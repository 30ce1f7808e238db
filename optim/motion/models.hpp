// SPDX-License-Identifier: Apache-2.0
// The motion models by name, and what of their parameters is made or asked on the host. A new model
// is one more word here, beside its own four files.
#pragma once
#include <array>
#include <map>
#include <memory>

#include "optim/motion/motion.hpp"

namespace gflow {

enum class MotionModelKind { spacetime, native4d, keyframes, bases };
constexpr std::array<const char*, 4> names_of(MotionModelKind) {
  return {"spacetime", "native4d", "keyframes", "bases"};
}

// What a motion model must know beside its arrays.
struct MotionShape {
  MotionModelKind motion = MotionModelKind::spacetime;
  float duration = 1;    // length of the video in the model's time; > 0
  float cutoff = 0.05f;  // temporal weight, in [0, 1), at or below which a Gaussian is skipped
  int keys = 0;          // keyframes, bases: moments at which the paths are held
  int bases = 0;         // bases: motions that all Gaussians share

  // Calls field(name, member) for each number that this model's files hold; all are above 0.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("duration", self.duration);
    field("cutoff", self.cutoff);
    if (self.motion >= MotionModelKind::keyframes) field("keys", self.keys);
    if (self.motion == MotionModelKind::bases) field("bases", self.bases);
  }
};

std::unique_ptr<Motion> make_motion(Queue& queue, const MotionShape& shape);

// Parameter arrays on the host by group name, a row a Gaussian.
using HostGroups = std::map<std::string, std::vector<float>>;

// A group that only this model has a row a Gaussian of, and the properties of a PLY that hold its
// columns.
struct MotionColumns {
  std::string group;
  std::vector<std::string> properties;
};
std::vector<MotionColumns> motion_columns(const MotionShape& shape);

// Its tables with other rows.
std::vector<TableSpec> motion_tables(const MotionShape& shape);

// Fills all of those for `count` Gaussians that stand still, turned as "quats" says.
void add_rest(const MotionShape& shape, HostGroups& groups, size_t count);

// Gives Gaussian i, at rest, not turned, of spatial scale s and temporal scale s_t, the velocity v;
// native4d: or the largest along v that those scales allow; keyframes: around its own moment;
// bases: none, as no Gaussian has a motion of its own.
void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t);

// Whether no Gaussian moves.
bool at_rest(const MotionShape& shape, const HostGroups& groups);

}  // namespace gflow
