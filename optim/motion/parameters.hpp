// SPDX-License-Identifier: Apache-2.0
// All trained arrays by name, in tables: one with a row per Gaussian, and those of a motion model
// with other rows. Losses, density control, files and Adam iterate over tables and groups and do
// not depend on the motion model.
#pragma once
#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "runtime/primitives/adam.hpp"

namespace gflow {

// Kind of a group's values; selects their learning rate.
enum class Quantity {
  position,
  time,
  rotation,
  scale,
  opacity,
  color,
  color_rest,
  weight,
  plane,
  network
};

// A group's name and width, e.g. {"means", 3}.
struct GroupSpec {
  std::string name;
  size_t width;
  Quantity quantity = Quantity::position;
  int per_time = 0;        // order of the time derivative that it holds: 1 velocity, 2 acceleration
  bool motion = false;     // holds motion only: not trained if the scene has one time step
  bool moving = false;     // static Gaussians have no rows in it
  float static_value = 0;  // value of such a group for static Gaussians
  std::string static_source = "";  // group that holds these values instead; empty: none
};

// Groups that share their rows.
class Table {
 public:
  // `count` rows with undefined values, zero gradients and moments; groups with GroupSpec::moving
  // have the first `moving` rows only. learns = false: no gradients and moments, a quarter of the
  // memory.
  Table(Queue& queue, size_t count, size_t moving, std::vector<GroupSpec> specs, bool learns = true)
      : count(count),
        moving(moving),
        specs(std::move(specs)),
        rows(queue, count),
        active{0, count} {
    groups.reserve(this->specs.size());
    for (const GroupSpec& spec : this->specs)
      groups.emplace_back(queue, spec.name, rows_of(spec), spec.width, learns);
  }

  size_t rows_of(const GroupSpec& spec) const { return spec.moving ? moving : count; }
  // The active rows that the group has.
  RowRange active_in(const GroupSpec& spec) const {
    const size_t end = std::min(active.first + active.count, rows_of(spec));
    return {active.first, end - std::min(active.first, end)};
  }

  // nullptr if there is no such group.
  const ParameterGroup* find(const std::string& name) const {
    for (size_t i = 0; i < specs.size(); ++i)
      if (specs[i].name == name) return &groups[i];
    return nullptr;
  }

  size_t count, moving;
  std::vector<GroupSpec> specs;
  std::vector<ParameterGroup> groups;  // as specs
  RowState rows;
  RowRange active;  // rows that this training step may have seen; all others have rows.seen = 0
};

// A table besides that of the Gaussians: `rows` rows that all Gaussians share, or `keys` rows per
// dynamic Gaussian. Row k M + i is key k of dynamic Gaussian i of M.
struct TableSpec {
  std::vector<GroupSpec> groups;
  size_t rows = 0, keys = 0;
  size_t count(size_t moving) const { return rows + keys * moving; }
};

// The table of the Gaussians, and the others. The first `moving` Gaussians are dynamic. The others
// are static: "means" and "quats" hold their pose, and they have no rows for motion.
class Parameters : public Table {
 public:
  static constexpr size_t all = std::numeric_limits<size_t>::max();

  Parameters(Queue& queue, size_t count, std::vector<GroupSpec> specs,
             std::vector<TableSpec> more_specs = {}, size_t moving = all, bool learns = true)
      : Table(queue, count, std::min(count, moving), std::move(specs), learns),
        more_specs(std::move(more_specs)) {
    for (const TableSpec& spec : this->more_specs) {
      const size_t table_rows = spec.count(this->moving);
      more.emplace_back(queue, table_rows, table_rows, spec.groups, learns);
      more.back().active = {0, 0};
    }
  }

  // A group of any table. Error if there is none of that name.
  const ParameterGroup& operator[](const std::string& name) const {
    if (const ParameterGroup* group = find(name)) return *group;
    for (const Table& table : more)
      if (const ParameterGroup* group = table.find(name)) return *group;
    throw Error("there is no parameter group '" + name + "' in this model");
  }
  ParameterGroup& operator[](const std::string& name) {
    return const_cast<ParameterGroup&>(std::as_const(*this)[name]);
  }

  // All tables, that of the Gaussians first.
  std::vector<Table*> tables() {
    std::vector<Table*> all{this};
    for (Table& table : more) all.push_back(&table);
    return all;
  }
  std::vector<const Table*> tables() const {
    std::vector<const Table*> all{this};
    for (const Table& table : more) all.push_back(&table);
    return all;
  }
  // Whether any rows exist for dynamic Gaussians only.
  bool has_motion_rows() const {
    const auto own = [](const GroupSpec& spec) { return spec.moving; };
    const auto keyed = [](const TableSpec& table) { return table.keys > 0; };
    return std::any_of(specs.begin(), specs.end(), own) ||
           std::any_of(more_specs.begin(), more_specs.end(), keyed);
  }

  // Before a training step: marks all rows as not seen.
  void forget_seen(Queue& queue) {
    rows.seen.fill(queue, 0u);
    for (Table& table : more) {
      table.rows.seen.fill_range(queue, table.active.first, table.active.count, 0u);
      table.active = {0, 0};
    }
  }

  // Instead of forget_seen(): marks every Gaussian that was ever seen as seen, with zero gradients.
  void count_as_seen(Queue& queue) {
    forget_seen(queue);
    rows.seen.copy_from(queue, rows.steps);
    for (ParameterGroup& group : groups) group.grads.fill(queue, 0.f);
  }

  std::vector<TableSpec> more_specs;
  std::vector<Table> more;  // as more_specs
};

}  // namespace gflow
