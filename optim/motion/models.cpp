// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/models.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/motion/bases.hpp"
#include "optim/motion/hexplane.hpp"
#include "optim/motion/keyframes.hpp"
#include "optim/motion/motion_options.hpp"
#include "optim/motion/native4d.hpp"
#include "optim/motion/nodes.hpp"
#include "optim/motion/spacetime.hpp"

namespace gflow {
namespace {

// In the order of MotionModelKind.
std::vector<const MotionModel*>& models() {
  static std::vector<const MotionModel*> all = {&spacetime_model(), &native4d_model(),
                                                &keyframes_model(), &bases_model(),
                                                &hexplane_model(),  &nodes_model()};
  return all;
}

}  // namespace

const std::vector<const MotionModel*>& motion_models() { return models(); }

const MotionModel& motion_model_of(MotionModelKind kind) {
  if (size_t(kind) >= models().size())
    throw Error(fmt::format("there is no motion model number {}", int(kind)));
  return *models()[size_t(kind)];
}

MotionModelKind register_motion_model(const MotionModel& model) {
  for (const MotionModel* other : models())
    if (std::string(other->name) == model.name)
      throw Error(fmt::format("a motion model named {} is already registered", model.name));
  models().push_back(&model);
  return MotionModelKind(models().size() - 1);
}

std::vector<const char*> names_of(MotionModelKind) {
  std::vector<const char*> names;
  for (const MotionModel* model : models()) names.push_back(model->name);
  return names;
}

MotionShape motion_shape(MotionModelKind kind, const MotionOptions& options, int time_steps) {
  const MotionModel& model = motion_model_of(kind);
  MotionShape shape;
  shape.motion = kind;
  shape.cutoff = options.cutoff;
  shape.own = options.own_of(model);
  if (model.set_numbers) model.set_numbers(shape, options, std::max(time_steps, 1));
  return shape;
}

void enclose(MotionShape& shape, const std::vector<float>& means, const MotionOptions& options) {
  if (const auto set = motion_model_of(shape.motion).enclose) set(shape, means, options);
}

void enclose_as(MotionShape& shape, const MotionShape& from) {
  MotionShape source = from;
  for (const ShapeNumber& number : motion_model_of(shape.motion).kept_numbers) {
    if (number.whole)
      number.whole(shape) = number.whole(source);
    else
      number.real(shape) = number.real(source);
  }
}

bool has_number(const MotionModel& model, const std::string& name) {
  return std::any_of(model.numbers.begin(), model.numbers.end(),
                     [&](const ShapeNumber& number) { return name == number.name; });
}

std::unique_ptr<Motion> make_motion(Queue& queue, const MotionShape& shape) {
  MotionShape complete = shape;
  complete.own = shape.own_numbers();
  return motion_model_of(shape.motion).make(queue, complete);
}

std::vector<MotionColumns> motion_columns(const MotionShape& shape) {
  const auto columns = motion_model_of(shape.motion).columns;
  return columns ? columns(shape) : std::vector<MotionColumns>{};
}

std::vector<GroupSpec> motion_groups(const MotionShape& shape) {
  return motion_model_of(shape.motion).groups(shape);
}

std::vector<TableSpec> motion_tables(const MotionShape& shape) {
  const auto tables = motion_model_of(shape.motion).tables;
  return tables ? tables(shape) : std::vector<TableSpec>{};
}

void set_static(const MotionShape& shape, HostGroups& groups, size_t count, uint32_t seed) {
  for (const MotionColumns& columns : motion_columns(shape))
    groups[columns.group].assign(columns.properties.size() * count, 0.f);
  for (const TableSpec& table : motion_tables(shape))
    for (const GroupSpec& group : table.groups)
      groups[group.name].assign(group.width * table.count(count), 0.f);
  if (const auto set = motion_model_of(shape.motion).set_static) set(shape, groups, count, seed);
}

void set_velocity(const MotionShape& shape, HostGroups& groups, size_t i,
                  const std::array<double, 3>& v, double s, double s_t) {
  if (const auto set = motion_model_of(shape.motion).set_velocity) set(shape, groups, i, v, s, s_t);
}

bool is_static(const MotionShape& shape, const HostGroups& groups) {
  if (const auto answer = motion_model_of(shape.motion).is_static) return answer(shape, groups);
  const auto zero = [&](const std::string& group) {
    const std::vector<float>& values = groups.at(group);
    return std::all_of(values.begin(), values.end(), [](float x) { return x == 0; });
  };
  for (const MotionColumns& columns : motion_columns(shape))
    if (!zero(columns.group)) return false;
  for (const TableSpec& table : motion_tables(shape))
    for (const GroupSpec& group : table.groups)
      if (!zero(group.name)) return false;
  return true;
}

}  // namespace gflow
