// SPDX-License-Identifier: Apache-2.0
// The motion models by name, and what of their parameters is made or asked on the host. A new model
// is one more word here, beside its own four files.
#pragma once
#include <array>
#include <limits>
#include <map>
#include <memory>

#include "optim/motion/motion.hpp"

namespace gflow {

enum class MotionModelKind { spacetime, native4d, keyframes, bases, hexplane };
constexpr std::array<const char*, 5> names_of(MotionModelKind) {
  return {"spacetime", "native4d", "keyframes", "bases", "hexplane"};
}

// What a motion model must know beside its arrays.
struct MotionShape {
  MotionModelKind motion = MotionModelKind::spacetime;
  float duration = 1;    // length of the video in the model's time; > 0
  float cutoff = 0.05f;  // temporal weight, in [0, 1), at or below which a Gaussian is skipped
  int keys = 0;          // keyframes, bases: moments at which the paths are held
  int key_scales = 0;    // keyframes: 1 where sizes have keys, too
  int bases = 0;         // bases: motions that all Gaussians share
  HexplaneShape hexplane;

  // Calls field(name, member, lowest, highest) for each number that this model's files hold; all
  // are above `lowest` and at most `highest`.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("duration", self.duration, 0.0, 1e30);
    field("cutoff", self.cutoff, -std::numeric_limits<double>::denorm_min(), 0.5);  // may be 0
    const bool keyed =
        self.motion == MotionModelKind::keyframes || self.motion == MotionModelKind::bases;
    if (keyed) field("keys", self.keys, 0.0, 1e6);
    if (self.motion == MotionModelKind::keyframes) field("key_scales", self.key_scales, -1.0, 1.0);
    if (self.motion == MotionModelKind::bases) field("bases", self.bases, 0.0, 1e3);
    if (self.motion != MotionModelKind::hexplane) return;
    auto& h = self.hexplane;
    field("resolution", h.resolution, 1.0, 1e4);
    field("times", h.times, 0.0, 1e6);
    field("levels", h.levels, 0.0, 16.0);
    field("channels", h.channels, 0.0, 1e3);
    field("hidden", h.hidden, 0.0, 1e3);
    field("layers", h.layers, 0.0, 1e3);
    const char* const centre[] = {"centre_x", "centre_y", "centre_z"};
    const char* const half_size[] = {"half_size_x", "half_size_y", "half_size_z"};
    for (size_t axis = 0; axis < 3; ++axis) {
      field(centre[axis], h.centre[axis], -1e30, 1e30);
      field(half_size[axis], h.half_size[axis], 0.0, 1e30);
    }
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

// Its arrays with a row a Gaussian, and its tables with other rows: Motion::groups and tables
// without a device.
std::vector<GroupSpec> motion_groups(const MotionShape& shape);
std::vector<TableSpec> motion_tables(const MotionShape& shape);

// Fills all of those for `count` Gaussians that stand still, turned as "quats" says. `seed`: of
// what starts at random.
void add_rest(const MotionShape& shape, HostGroups& groups, size_t count, uint32_t seed = 0);

// Whether every Gaussian lasts for the whole video: there is one common pose, and what moves is
// that, not which Gaussians there are.
constexpr bool is_permanent(MotionModelKind kind) { return kind == MotionModelKind::hexplane; }
// Whether each Gaussian has one path of few numbers for all of its life.
constexpr bool has_stiff_paths(MotionModelKind kind) {
  return kind == MotionModelKind::spacetime || kind == MotionModelKind::native4d;
}

// Gives Gaussian i, at rest, not turned, of spatial scale s and temporal scale s_t, the velocity v;
// native4d: or the largest along v that those scales allow; keyframes: around its own moment;
// bases and hexplane: none, as no Gaussian has a motion of its own.
void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t);

// Whether no Gaussian moves.
bool at_rest(const MotionShape& shape, const HostGroups& groups);

}  // namespace gflow
