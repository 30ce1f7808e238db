// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/parameters_state.hpp"

namespace gflow {
namespace {

constexpr const char* moving_name = "gaussians/moving";

// Calls visit(name, buffer, shape) for every buffer that is kept; parameters are const or not.
template <class P, class Visit>
void for_each_buffer(P& parameters, Visit&& visit) {
  const auto tables = parameters.tables();
  for (size_t t = 0; t < tables.size(); ++t) {
    auto& table = *tables[t];
    const std::string name = t == 0 ? "gaussians/" : fmt::format("table{}/", t);
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
  const size_t count = array_named(arrays, "gaussians/rows/steps", path).size();
  const size_t moving = exact_values<uint32_t>(arrays, moving_name, {1}, path)[0];
  Parameters loaded(queue, count, parameters.specs, parameters.more_specs, moving);
  for_each_buffer(
      loaded, [&](const std::string& name, auto& buffer, const std::vector<size_t>& shape) {
        using Values = decltype(buffer.read(queue));
        buffer.write(queue, exact_values<typename Values::value_type>(arrays, name, shape, path));
      });
  parameters = std::move(loaded);
}

}  // namespace gflow
