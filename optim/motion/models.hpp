// SPDX-License-Identifier: Apache-2.0
// The motion models in one table: everything that the rest of gflow asks about a model. A new model
// needs its own files and one line in models.cpp, or register_motion_model() from outside.
#pragma once
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "optim/motion/motion.hpp"

namespace gflow {

// Number of a model in the table. gflow's own models have names here; registered ones follow.
enum class MotionModelKind { spacetime, native4d, keyframes, bases, hexplane };

struct MotionShape;

// Parameter arrays on the host by group name, those of other tables included.
using HostGroups = std::map<std::string, std::vector<float>>;

// A group with a row per Gaussian that only this model has, and the PLY properties of its columns.
struct MotionColumns {
  std::string group;
  std::vector<std::string> properties;
};

// A motion model. Functions may be nullptr where a comment says so.
struct MotionModel {
  const char* name = nullptr;  // in settings and files

  // Numbers of MotionShape that its arrays depend on, besides duration and cutoff.
  bool has_keys = false, has_key_scales = false, has_bases = false, has_planes = false;
  // Every Gaussian lasts for the whole video; one canonical pose is deformed over time.
  bool is_permanent = false;
  // Each Gaussian has one path of few parameters over its lifetime.
  bool has_stiff_paths = false;

  std::unique_ptr<Motion> (*make)(Queue&, const MotionShape&) = nullptr;
  // As Motion::groups and Motion::tables, without a device. tables: nullptr if there are none.
  std::vector<GroupSpec> (*groups)(const MotionShape&) = nullptr;
  std::vector<TableSpec> (*tables)(const MotionShape&) = nullptr;
  // Groups in the PLY besides those of every model; nullptr: none.
  std::vector<MotionColumns> (*columns)(const MotionShape&) = nullptr;
  // Turns zero arrays into those of `count` static Gaussians with the rotations in "quats";
  // nullptr: zeros are static already. `seed`: of random initial values.
  void (*set_static)(const MotionShape&, HostGroups&, size_t count, uint32_t seed) = nullptr;
  // Initialises what all Gaussians share from the Gaussians number `first` and later; nullptr:
  // nothing to do.
  void (*place)(const MotionShape&, HostGroups&, size_t first) = nullptr;
  // See set_velocity() below; nullptr: Gaussians have no motion of their own.
  void (*set_velocity)(const MotionShape&, HostGroups&, size_t i, const std::array<double, 3>& v,
                       double s, double s_t) = nullptr;
  // Whether no Gaussian moves; nullptr: true if all of `columns` and `tables` are 0.
  bool (*is_static)(const MotionShape&, const HostGroups&) = nullptr;
};

const MotionModel& motion_model_of(MotionModelKind kind);
// Adds a model, which must outlive all use, and returns its number. Error if the name is taken.
MotionModelKind register_motion_model(const MotionModel& model);
// Names in the order of their numbers.
std::vector<const char*> names_of(MotionModelKind);

// Numbers that define the arrays of a motion model.
struct MotionShape {
  MotionModelKind motion = MotionModelKind::spacetime;
  float duration = 1;    // length of the video in model time; > 0
  float cutoff = 0.05f;  // temporal weight, in [0, 1), at or below which a Gaussian is skipped
  int keys = 0;          // keyframes, bases: number of keys
  int key_scales = 0;    // keyframes: 1 if scales have keys, too
  int bases = 0;         // bases: number of shared rigid motions
  HexplaneShape hexplane;

  // Calls field(name, member, lowest, highest) for each number that files of this model store;
  // valid values are above `lowest` and at most `highest`.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("duration", self.duration, 0.0, 1e30);
    field("cutoff", self.cutoff, -std::numeric_limits<double>::denorm_min(), 0.5);  // may be 0
    const MotionModel& model = motion_model_of(self.motion);
    if (model.has_keys) field("keys", self.keys, 0.0, 1e6);
    if (model.has_key_scales) field("key_scales", self.key_scales, -1.0, 1.0);
    if (model.has_bases) field("bases", self.bases, 0.0, 1e3);
    if (!model.has_planes) return;
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

// The following use the table entry of shape.motion.
std::unique_ptr<Motion> make_motion(Queue& queue, const MotionShape& shape);
std::vector<MotionColumns> motion_columns(const MotionShape& shape);
std::vector<GroupSpec> motion_groups(const MotionShape& shape);
std::vector<TableSpec> motion_tables(const MotionShape& shape);
inline bool is_permanent(MotionModelKind kind) { return motion_model_of(kind).is_permanent; }
inline bool has_stiff_paths(MotionModelKind kind) { return motion_model_of(kind).has_stiff_paths; }

// Sets all groups and tables of `count` static Gaussians with the rotations in "quats". `seed`: of
// random initial values.
void set_static(const MotionShape& shape, HostGroups& groups, size_t count, uint32_t seed = 0);

// Gives Gaussian i the velocity v [scene units per unit of model time]. It must be static and
// unrotated, with spatial scale s and temporal scale s_t. native4d: limited to the largest speed
// that these scales allow. keyframes: only around its temporal mean. No effect in models whose
// Gaussians have no motion of their own.
void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t);

// Whether no Gaussian moves.
bool is_static(const MotionShape& shape, const HostGroups& groups);

}  // namespace gflow
