// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/parameters_state.hpp"

#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

constexpr const char* moving_name = "gaussians/moving";

// What stands before the names of a table's arrays; 0: that of the Gaussians.
std::string table_name(size_t table) {
  return table == 0 ? "gaussians/" : fmt::format("table{}/", table);
}

// Calls visit(name, buffer, shape) for every buffer that is kept; parameters are const or not.
template <class P, class Visit>
void for_each_buffer(P& parameters, Visit&& visit) {
  const auto tables = parameters.tables();
  for (size_t t = 0; t < tables.size(); ++t) {
    auto& table = *tables[t];
    const std::string name = table_name(t);
    for (size_t g = 0; g < table.groups.size(); ++g) {
      auto& group = table.groups[g];
      const std::string values = name + table.specs[g].name;
      const std::vector<size_t> shape{table.rows_of(table.specs[g]), group.width};
      visit(values, group.values, shape);
      visit(values + "/exp_avg", group.exp_avg, shape);
      visit(values + "/exp_avg_sq", group.exp_avg_sq, shape);
    }
    const std::vector<size_t> shape{table.count};
    visit(name + "rows/steps", table.rows.steps, shape);
    visit(name + "rows/refused", table.rows.refused, shape);
    visit(name + "rows/pace", table.rows.pace, shape);
    visit(name + "rows/reach", table.rows.reach, shape);
  }
}

size_t count_of(const Arrays& arrays, const std::string& path) {
  return array_named(arrays, table_name(0) + "rows/steps", path).size();
}
size_t moving_of(const Arrays& arrays, const std::string& path) {
  return exact_values<uint32_t>(arrays, moving_name, {1}, path)[0];
}

}  // namespace

void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays) {
  for_each_buffer(parameters, [&](const std::string& name, const auto& buffer,
                                  const std::vector<size_t>& shape) {
    arrays[name] = {shape, buffer.read(queue)};
  });
  arrays[moving_name] = {{1}, std::vector<uint32_t>{uint32_t(parameters.moving)}};
}

void load_state(Queue& queue, Parameters& parameters, const Arrays& arrays,
                const std::string& path) {
  const size_t count = count_of(arrays, path), moving = moving_of(arrays, path);
  Parameters loaded(queue, count, parameters.specs, parameters.more_specs, moving);
  for_each_buffer(
      loaded, [&](const std::string& name, auto& buffer, const std::vector<size_t>& shape) {
        using Values = decltype(buffer.read(queue));
        buffer.write(queue, exact_values<typename Values::value_type>(arrays, name, shape, path));
      });
  parameters = std::move(loaded);
}

std::string unsound_array(const Arrays& arrays) {
  const std::string second = "/exp_avg_sq";
  for (const auto& [name, array] : arrays) {
    const auto* values = std::get_if<std::vector<float>>(&array.values);
    if (!values || (name.rfind("gaussians/", 0) != 0 && name.rfind("table", 0) != 0)) continue;
    const bool is_second = name.size() > second.size() &&
                           name.compare(name.size() - second.size(), second.size(), second) == 0;
    for (const float value : *values)
      if (!std::isfinite(value) || (is_second && value < 0)) return name;
  }
  return "";
}

StateValues state_values(const Arrays& arrays, const std::vector<GroupSpec>& specs,
                         const std::vector<TableSpec>& more_specs, const std::string& path) {
  StateValues values;
  values.count = count_of(arrays, path);
  values.moving = std::min(moving_of(arrays, path), values.count);
  const auto take = [&](size_t table, const GroupSpec& spec, size_t rows) {
    values.groups[spec.name] =
        exact_values<float>(arrays, table_name(table) + spec.name, {rows, spec.width}, path);
  };
  for (const GroupSpec& spec : specs) take(0, spec, spec.moving ? values.moving : values.count);
  for (size_t t = 0; t < more_specs.size(); ++t)
    for (const GroupSpec& spec : more_specs[t].groups)
      take(t + 1, spec, more_specs[t].count(values.moving));
  return values;
}

}  // namespace gflow
