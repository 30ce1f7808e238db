// SPDX-License-Identifier: Apache-2.0
// The motion models in one table: everything that the rest of gflow asks about a model. A new model
// needs its own files and one line in models.cpp, or register_motion_model() from outside.
#pragma once
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "optim/motion/hexplane_options.hpp"
#include "optim/motion/motion.hpp"
#include "optim/motion/own_numbers.hpp"

namespace gflow {

// Number of a model in the table. gflow's own models have names here; registered ones follow.
enum class MotionModelKind { spacetime, native4d, keyframes, bases, hexplane, nodes };

struct MotionOptions;
struct MotionShape;

// A number of MotionShape that files of a model store. Valid values are above `lowest` and at most
// `highest`.
struct ShapeNumber {
  ShapeNumber(const char* name, int& (*member)(MotionShape&), double lowest, double highest)
      : name(name), whole(member), lowest(lowest), highest(highest) {}
  ShapeNumber(const char* name, float& (*member)(MotionShape&), double lowest, double highest)
      : name(name), real(member), lowest(lowest), highest(highest) {}

  const char* name;
  int& (*whole)(MotionShape&) = nullptr;  // one of the two is set
  float& (*real)(MotionShape&) = nullptr;
  double lowest, highest;
};
// Whether files may lack this number, which older versions did not write; it is 0 then.
inline bool may_be_missing(const std::string& number) {
  return number == "key_scales" || number == "time_spline";
}

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

  // Settings of its own, in section [name]; its files store them, and `make` finds them in
  // MotionShape::own.
  std::vector<OwnNumber> own;
  // Numbers of MotionShape that its arrays depend on, besides duration and cutoff; and those of
  // them that a resumed run takes from its checkpoint, because they depend on the initial Gaussians
  // or on what a version of gflow made of the settings.
  std::vector<ShapeNumber> numbers, kept_numbers;
  // Sets `numbers` from the settings. time_steps: of the video, at least 1. nullptr: none to set.
  void (*set_numbers)(MotionShape&, const MotionOptions&, int time_steps) = nullptr;
  // Sets those of `kept_numbers` that set_numbers() does not. means [n, 3] of the initial
  // Gaussians. nullptr: none to set.
  void (*enclose)(MotionShape&, const std::vector<float>& means, const MotionOptions&) = nullptr;
  // Every Gaussian lasts for the whole video; one canonical pose is deformed over time.
  bool is_permanent = false;
  // Each Gaussian has one path of few parameters over its lifetime.
  bool has_stiff_paths = false;
  // Scales and quats may be learnt faster in short trainings (lr.steps) without harm to motion.
  bool has_quick_shapes = true;

  std::unique_ptr<Motion> (*make)(Queue&, const MotionShape&) = nullptr;
  // As Motion::groups and Motion::tables, without a device. tables: nullptr if there are none.
  std::vector<GroupSpec> (*groups)(const MotionShape&) = nullptr;
  std::vector<TableSpec> (*tables)(const MotionShape&) = nullptr;
  // Groups in the PLY besides those of every model; nullptr: none.
  std::vector<MotionColumns> (*columns)(const MotionShape&) = nullptr;
  // Turns zero arrays into those of `count` static Gaussians with the rotations in "quats";
  // nullptr: zeros are static already. `seed`: of random initial values.
  void (*set_static)(const MotionShape&, HostGroups&, size_t count, uint32_t seed) = nullptr;
  // Initialises what all Gaussians share from those in [first, end), the dynamic ones; nullptr:
  // nothing to do.
  void (*place)(const MotionShape&, HostGroups&, size_t first, size_t end) = nullptr;
  // See set_velocity() below; nullptr: Gaussians have no motion of their own.
  void (*set_velocity)(const MotionShape&, HostGroups&, size_t i, const std::array<double, 3>& v,
                       double s, double s_t) = nullptr;
  // Number of keys that each Gaussian has for itself, so that they can be trained one by one
  // (Motion::start_key); nullptr: none.
  int (*keys)(const MotionShape&) = nullptr;
  // Standard deviation of Gaussian i's opacity over time [model time]; nullptr: exp of log_scales
  // t.
  double (*lifetime)(const HostGroups&, size_t i) = nullptr;
  // Whether no Gaussian moves; nullptr: true if all of `columns` and `tables` are 0.
  bool (*is_static)(const MotionShape&, const HostGroups&) = nullptr;
};

const MotionModel& motion_model_of(MotionModelKind kind);
// Adds a model, which must outlive all use, and returns its number. Error if the name is taken.
MotionModelKind register_motion_model(const MotionModel& model);
// All models, in the order of their numbers, and their names.
const std::vector<const MotionModel*>& motion_models();
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
  OwnNumbers own;  // of a model that declares its own

  // Calls field(name, member, lowest, highest) for each number that files of this model store;
  // valid values are above `lowest` and at most `highest`.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    const double below_0 = -std::numeric_limits<double>::denorm_min();
    field("duration", self.duration, 0.0, 1e30);
    field("cutoff", self.cutoff, below_0, 0.5);
    const MotionModel& model = motion_model_of(self.motion);
    for (const auto* numbers : {&model.numbers, &model.kept_numbers})
      for (const ShapeNumber& number : *numbers) {
        if (number.whole)
          field(number.name, member(self, number.whole), number.lowest, number.highest);
        else
          field(number.name, member(self, number.real), number.lowest, number.highest);
      }
    const auto visit = [&](const char* key, auto& value, const Help&, const Allowed& range) {
      const double min = range.min;
      field(key, value, range.above_min ? min : std::nextafter(min, -1e300), double(range.max));
    };
    if constexpr (std::is_const_v<Self>) {
      const OwnNumbers own = self.own_numbers();
      OwnNumbers::fields(own, visit);
    } else {
      self.own = self.own_numbers();
      OwnNumbers::fields(self.own, visit);
    }
  }

  // `own`, or what the model declares if they are not set.
  OwnNumbers own_numbers() const {
    return own.empty() ? OwnNumbers(motion_model_of(motion).own) : own;
  }

 private:
  template <class Number>
  static Number& member(MotionShape& self, Number& (*of)(MotionShape&)) {
    return of(self);
  }
  template <class Number>
  static const Number& member(const MotionShape& self, Number& (*of)(MotionShape&)) {
    return of(const_cast<MotionShape&>(self));
  }
};

// Shape of a new model: numbers from settings, those of initial Gaussians still at their defaults.
MotionShape motion_shape(MotionModelKind kind, const MotionOptions& options, int time_steps);
// Sets the numbers that depend on the initial Gaussians: from their means, or as in `from`, which
// is a shape of the same model.
void enclose(MotionShape& shape, const std::vector<float>& means, const MotionOptions& options);
void enclose_as(MotionShape& shape, const MotionShape& from);
// Whether files of the model store a number of that name.
bool has_number(const MotionModel& model, const std::string& name);

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
