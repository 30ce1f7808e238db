// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/parameters_state.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {
namespace {

constexpr const char* moving_name = "gaussians/moving";
constexpr const char* now_name = "rows/now";
constexpr const char* last_name = "/rows/last";
constexpr const char* mean_gradient = "/exp_avg";  // absent in groups without a mean gradient

// Prefix of a table's array names; table 0 is that of the Gaussians.
std::string table_name(size_t table) {
  return table == 0 ? "gaussians/" : fmt::format("table{}/", table);
}

// Calls visit(name, buffer, shape) for every buffer that is saved; P is Parameters or const
// Parameters.
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
      visit(values + mean_gradient, group.exp_avg, shape);
      visit(values + "/exp_avg_sq", group.exp_avg_sq, shape);
    }
    const std::vector<size_t> shape{table.count};
    visit(name + "rows/steps", table.rows.steps, shape);
    visit(name + "rows/last", table.rows.last, shape);
    visit(name + "rows/refused", table.rows.rejected, shape);
    visit(name + "rows/pace", table.rows.rate_scale, shape);
    visit(name + "rows/reach", table.rows.rate_divisor, shape);
  }
}

size_t count_of(const Arrays& arrays, const std::string& path) {
  return array_named(arrays, table_name(0) + "rows/steps", path).size();
}
size_t moving_of(const Arrays& arrays, size_t count, const std::string& path) {
  const uint32_t moving = exact_values<uint32_t>(arrays, moving_name, {1}, path)[0];
  if (moving > count)
    throw Error(fmt::format("{} is damaged: {} of {} Gaussians are dynamic", path, moving, count));
  return moving;
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}
// Name of the rows/now array of the table of a rows/last array.
std::string now_beside(const std::string& last) {
  return last.substr(0, last.rfind(last_name) + 1) + now_name;
}

// Whether training can produce the values: all finite; rate_divisor > 0, because rates are divided
// by it; second moments, rate_scale and counts of density control >= 0; rate_scale <=
// PaceRule::kMost. Step counts must leave room for one more step.
bool is_finite_report(const std::string& name, const std::vector<float>& values) {
  const bool divides = ends_with(name, "/rows/reach"), paces = ends_with(name, "/rows/pace");
  const bool counts = name.rfind("density/", 0) == 0;  // gradients and views since the last round
  const bool from_0 = divides || paces || counts || ends_with(name, "/exp_avg_sq");
  return std::all_of(values.begin(), values.end(), [&](float value) {
    return std::isfinite(value) && !(from_0 && value < 0) && !(divides && value == 0) &&
           !(paces && value > PaceRule::kMost);
  });
}
bool is_finite_report(const Arrays& arrays, const std::string& name,
                      const std::vector<uint32_t>& values, uint32_t steps) {
  const auto at_most = [&](uint32_t most) {
    return std::all_of(values.begin(), values.end(), [&](uint32_t value) { return value <= most; });
  };
  if (ends_with(name, last_name)) {  // a row's last step is at most the table's current one
    const auto now = arrays.find(now_beside(name));
    const auto* step =
        now == arrays.end() ? nullptr : std::get_if<std::vector<uint32_t>>(&now->second.values);
    return !step || step->size() != 1 || at_most(step->front());
  }
  if (ends_with(name, std::string("/") + now_name)) return at_most(steps);
  return !ends_with(name, "/rows/steps") || at_most(std::numeric_limits<int>::max());
}

}  // namespace

void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays) {
  for_each_buffer(parameters, [&](const std::string& name, const auto& buffer,
                                  const std::vector<size_t>& shape) {
    // Other empty arrays have no rows or no columns and are saved.
    if (ends_with(name, mean_gradient) && buffer.size() == 0) return;
    arrays[name] = {shape, buffer.read(queue)};
  });
  arrays[moving_name] = {{1}, std::vector<uint32_t>{uint32_t(parameters.moving)}};
  const auto tables = parameters.tables();
  for (size_t t = 0; t < tables.size(); ++t)
    arrays[table_name(t) + now_name] = {{1}, std::vector<uint32_t>{tables[t]->rows.now}};
}

void load_state(Queue& queue, Parameters& parameters, const Arrays& arrays,
                const std::string& path) {
  const size_t count = count_of(arrays, path), moving = moving_of(arrays, count, path);
  Parameters loaded(queue, count, parameters.specs, parameters.more_specs, moving);
  for_each_buffer(
      loaded, [&](const std::string& name, auto& buffer, const std::vector<size_t>& shape) {
        using Values = decltype(buffer.read(queue));
        if (ends_with(name, mean_gradient)) {
          if (arrays.count(name) == 0) return;
          buffer.ensure(queue, shape[0] * shape[1]);
        }
        buffer.write(queue, exact_values<typename Values::value_type>(arrays, name, shape, path));
      });
  const auto tables = loaded.tables();
  for (size_t t = 0; t < tables.size(); ++t)
    tables[t]->rows.now = exact_values<uint32_t>(arrays, table_name(t) + now_name, {1}, path)[0];
  parameters = std::move(loaded);
}

std::string non_finite_array(const Arrays& arrays, uint32_t steps) {
  for (const auto& [name, array] : arrays) {
    const auto of = [&name = name](const char* place) { return name.rfind(place, 0) == 0; };
    if (!of("gaussians/") && !of("table") && !of("density/")) continue;
    const auto* floats = std::get_if<std::vector<float>>(&array.values);
    const auto* counts = std::get_if<std::vector<uint32_t>>(&array.values);
    if ((floats && !is_finite_report(name, *floats)) ||
        (counts && !is_finite_report(arrays, name, *counts, steps)))
      return ends_with(name, last_name) ? name + "' or '" + now_beside(name) : name;
  }
  return "";
}

StateValues state_values(const Arrays& arrays, const std::vector<GroupSpec>& specs,
                         const std::vector<TableSpec>& more_specs, const std::string& path) {
  StateValues values;
  values.count = count_of(arrays, path);
  values.moving = moving_of(arrays, values.count, path);
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
