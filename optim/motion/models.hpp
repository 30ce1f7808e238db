// SPDX-License-Identifier: Apache-2.0
// The motion models in one table: everything that the rest of gflow asks about a model. A new one
// is its own files and one line in models.cpp, or register_motion_model() from outside.
#pragma once
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "optim/motion/motion.hpp"

namespace gflow {

// The number of a model in the table. gflow's own have names here; registered ones follow.
enum class MotionModelKind { spacetime, native4d, keyframes, bases, hexplane };

struct MotionShape;

// Parameter arrays on the host by group name, a row per Gaussian.
using HostGroups = std::map<std::string, std::vector<float>>;

// A group with a row per Gaussian that only this model has, and the PLY properties of its columns.
struct MotionColumns {
  std::string group;
  std::vector<std::string> properties;
};

// A motion model. Functions may be nullptr where a comment says so.
struct MotionModel {
  const char* name = nullptr;  // in settings and files

  // Which numbers of MotionShape its arrays depend on, beside duration and cutoff.
  bool has_keys = false, has_key_scales = false, has_bases = false, has_planes = false;
  // Every Gaussian lasts for the whole video: one common pose moves.
  bool is_permanent = false;
  // Each Gaussian has one path of few parameters for all of its life.
  bool has_stiff_paths = false;

  std::unique_ptr<Motion> (*make)(Queue&, const MotionShape&) = nullptr;
  // Motion::groups and tables without a device; no tables: nullptr.
  std::vector<GroupSpec> (*groups)(const MotionShape&) = nullptr;
  std::vector<TableSpec> (*tables)(const MotionShape&) = nullptr;
  // Groups in the PLY beside those of every model; none: nullptr.
  std::vector<MotionColumns> (*columns)(const MotionShape&) = nullptr;
  // Turns arrays of zeros into those of `count` static Gaussians, turned as "quats" says; nullptr:
  // zeros are. `seed`: of what starts at random.
  void (*set_static)(const MotionShape&, HostGroups&, size_t count, uint32_t seed) = nullptr;
  // Lays out what all Gaussians share, by those from number `first` on; nullptr: nothing.
  void (*place)(const MotionShape&, HostGroups&, size_t first) = nullptr;
  // See set_velocity() below; nullptr: no Gaussian has a motion of its own.
  void (*set_velocity)(const MotionShape&, HostGroups&, size_t i, const std::array<double, 3>& v,
                       double s, double s_t) = nullptr;
  // Whether no Gaussian moves; nullptr: when all of `columns` and `tables` are 0.
  bool (*is_static)(const MotionShape&, const HostGroups&) = nullptr;
};

const MotionModel& motion_model_of(MotionModelKind kind);
// Adds a model, which must outlive all use, and returns its number. Error where the name is taken.
MotionModelKind register_motion_model(const MotionModel& model);
// All names, by number.
std::vector<const char*> names_of(MotionModelKind);

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

// By the descriptor of shape.motion.
std::unique_ptr<Motion> make_motion(Queue& queue, const MotionShape& shape);
std::vector<MotionColumns> motion_columns(const MotionShape& shape);
std::vector<GroupSpec> motion_groups(const MotionShape& shape);
std::vector<TableSpec> motion_tables(const MotionShape& shape);
inline bool is_permanent(MotionModelKind kind) { return motion_model_of(kind).is_permanent; }
inline bool has_stiff_paths(MotionModelKind kind) { return motion_model_of(kind).has_stiff_paths; }

// Fills all groups and tables for `count` static Gaussians, turned as "quats" says. `seed`: of what
// starts at random.
void set_static(const MotionShape& shape, HostGroups& groups, size_t count, uint32_t seed = 0);

// Gives Gaussian i, static, not turned, of spatial scale s and temporal scale s_t, the velocity v;
// native4d: or the largest along v that those scales allow; keyframes: around its own time; nothing
// for models in which no Gaussian has a motion of its own.
void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t);

// Whether no Gaussian moves.
bool is_static(const MotionShape& shape, const HostGroups& groups);

}  // namespace gflow
