// SPDX-License-Identifier: Apache-2.0
#include "optim/model/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <type_traits>

#include "optim/formats/ply_comments.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/motion/parameters_state.hpp"
#include "runtime/base/decimal.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Consecutive PLY columns that are consecutive columns of a group.
struct ColumnBlock {
  std::string group;
  size_t first;
  std::vector<std::string> names;
};

std::vector<std::string> numbered(const std::string& stem, size_t count) {
  std::vector<std::string> names;
  for (size_t i = 0; i < count; ++i) names.push_back(stem + std::to_string(i));
  return names;
}

// All columns except f_rest, which the file stores channel by channel.
std::vector<ColumnBlock> column_blocks(bool moving, const MotionShape& shape) {
  std::vector<ColumnBlock> blocks{{"means", 0, {"x", "y", "z"}},
                                  {"sh0", 0, numbered("f_dc_", 3)},
                                  {"logit_opacities", 0, {"opacity"}},
                                  {"log_scales", 0, numbered("scale_", 3)},
                                  {"quats", 0, numbered("rot_", 4)}};
  if (moving) {
    blocks.push_back({"means_t", 0, {"t"}});
    blocks.push_back({"log_scales", 3, {"scale_t"}});
    for (const MotionColumns& columns : motion_columns(shape))
      blocks.push_back({columns.group, 0, columns.properties});
  }
  return blocks;
}

std::map<std::string, size_t> widths_of(const MotionShape& shape) {
  std::map<std::string, size_t> widths{{"means", 3},      {"means_t", 1},         {"quats", 4},
                                       {"log_scales", 4}, {"logit_opacities", 1}, {"sh0", 3}};
  for (const MotionColumns& columns : motion_columns(shape))
    widths[columns.group] = columns.properties.size();
  return widths;
}

// Reads the comment "key value" into `member`: a number above `lowest` and at most `highest`.
// Without it the member keeps its value: the file is from another program, or older than
// key_scales.
template <class Number>
void read_comment(const PlyTable& table, const std::string& key, Number& member, double lowest,
                  double highest, const std::string& path) {
  const auto text = comment_after(table, key + " ");
  const bool always_there = !may_be_missing(key) && comment_after(table, model_comment);
  if (!text && always_there)
    throw Error(
        fmt::format("reading {}: gflow wrote it, but its comment '{}' is missing: it is "
                    "damaged",
                    path, key));
  if (!text || is_foreign_comment(table, *text)) return;
  const auto numbers = only_numbers(*text);
  const double value = numbers && numbers->size() == 1 ? (*numbers)[0] : std::nan("");
  const bool whole = std::is_integral_v<Number>;
  const bool from_0 = lowest < 0 && lowest > -1e-300;  // `lowest` is just below 0, so 0 is valid
  if (!(value > lowest && value <= highest) || (whole && value != std::floor(value)))
    throw Error(fmt::format(
        "reading {}: its comment '{} {}' is damaged: expected a {}number {} {:g}, at most {:g}",
        path, key, excerpt(*text), whole ? "whole " : "", from_0 ? "of at least" : "above",
        from_0 ? 0 : lowest, highest));
  member = Number(value);
}

// The motion model of a file: its comment "gflow MODEL"; moving files without it are recognised by
// their properties.
MotionModelKind kind_of(const PlyTable& table, const std::string& path) {
  const auto names = names_of(MotionModelKind{});
  if (const auto word = comment_after(table, model_comment)) {
    const auto found = std::find(names.begin(), names.end(), *word);
    if (found != names.end()) return MotionModelKind(found - names.begin());
    throw Error(
        fmt::format("reading {}: unknown motion model in its comment 'gflow {}'; known models: {}",
                    path, excerpt(*word), fmt::join(names, ", ")));
  }
  return table.column("rot_r_0") >= 0 ? MotionModelKind::native4d : MotionModelKind::spacetime;
}

// Whether a file must say which Gaussians move: motion of their own is 0 where they do not.
constexpr const char* moves_property = "moves";
bool stores_moves(const HostModel& model) {
  return model.num_moving() < model.count && motion_columns(model.shape).empty();
}

// Sorts the rows of a table so that those of Gaussians that move are first; returns their number.
size_t put_moving_first(PlyTable& table) {
  const int column = table.column(moves_property);
  if (column < 0) return table.rows;
  const size_t width = table.names.size();
  std::vector<float> sorted;
  sorted.reserve(table.values.size());
  size_t moving = 0;
  for (const bool taken : {true, false})
    for (size_t i = 0; i < table.rows; ++i) {
      const float* row = &table.values[i * width];
      if ((row[column] > 0) != taken) continue;
      sorted.insert(sorted.end(), row, row + width);
      moving += taken;
    }
  table.values = std::move(sorted);
  return moving;
}

void write_tables(const std::string& path, const HostModel& model) {
  Arrays arrays;
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups)
      arrays[group.name] =
          Array{{table.count(model.count), group.width}, model.groups.at(group.name)};
  if (!arrays.empty()) write_npz(path, arrays);
}

void read_tables(const std::string& path, HostModel& model) {
  const std::vector<TableSpec> tables = motion_tables(model.shape);
  if (tables.empty()) return;
  if (!std::filesystem::exists(path))
    throw Error(fmt::format(
        "the motion of this {} model is in {}, which does not exist: it must be next to the PLY",
        name_of(model.shape.motion), path));
  size_t expected_bytes = always_plausible;  // initial values are equal and compress well
  for (const TableSpec& table : tables)
    for (const GroupSpec& group : table.groups)
      expected_bytes += table.count(model.count) * group.width * sizeof(float);
  const Arrays arrays = read_npz(path, {}, expected_bytes);
  for (const TableSpec& table : tables)
    for (const GroupSpec& group : table.groups) {
      const Array& array = array_named(arrays, group.name, path);
      const std::vector<size_t> expected{table.count(model.count), group.width};
      if (array.shape != expected)
        throw Error(fmt::format("reading {}: {} has shape {}, expected ({}, {})", path, group.name,
                                array.shape_text(), expected[0], expected[1]));
      model.groups[group.name] = array.as_float();
    }
}

// Expands a group with `blocks` blocks of rows, one row per dynamic Gaussian, to all Gaussians,
// because files store the motion of every one.
std::vector<float> for_all(const std::vector<float>& values, size_t blocks, size_t moving,
                           size_t count, const GroupSpec& spec, const HostGroups& groups) {
  std::vector<float> all(blocks * count * spec.width, spec.static_value);
  if (!spec.static_source.empty()) all = groups.at(spec.static_source);
  for (size_t k = 0; k < blocks; ++k) {
    const auto from = values.begin() + long(k * moving * spec.width);
    std::copy(from, from + long(moving * spec.width), all.begin() + long(k * count * spec.width));
  }
  return all;
}

// The reverse: what the first `moving` of `count` Gaussians have in each block of rows.
std::vector<float> for_moving(const std::vector<float>& values, size_t blocks, size_t moving,
                              size_t count, size_t width) {
  std::vector<float> rows;
  for (size_t k = 0; k < blocks; ++k) {
    const auto from = values.begin() + long(k * count * width);
    rows.insert(rows.end(), from, from + long(moving * width));
  }
  return rows;
}

// The model of values in which `moving` of `count` Gaussians have motion rows.
HostModel model_of_values(const ModelShape& shape, size_t count, size_t moving, HostGroups values) {
  HostModel host{shape, count, std::move(values), moving};
  if (moving == count) return host;
  const auto widen = [&](const GroupSpec& spec, size_t blocks) {
    std::vector<float>& rows = host.groups[spec.name];
    rows = for_all(rows, blocks, moving, count, spec, host.groups);
  };
  for (const GroupSpec& spec : model_groups(shape))
    if (spec.moving) widen(spec, 1);
  for (const TableSpec& table : motion_tables(shape))
    if (table.keys)
      for (const GroupSpec& spec : table.groups) widen(spec, table.keys);
  return host;
}

}  // namespace

std::vector<GroupSpec> model_groups(const ModelShape& shape) {
  std::vector<GroupSpec> specs = motion_groups(shape);
  for (const GroupSpec& spec : color_groups(shape.sh_degree)) specs.push_back(spec);
  return specs;
}

double longest_scale(const HostModel& model, size_t i) {
  const float* log_scales = &model.groups.at("log_scales")[4 * i];
  return std::exp(double(*std::max_element(log_scales, log_scales + 3)));
}

std::string tables_path(const std::string& path) {
  return std::filesystem::path(path).replace_extension(".motion.npz").string();
}

Model::Model(Queue& queue, const ModelShape& shape, size_t count, Purpose purpose, size_t moving)
    : shape(shape),
      motion(make_motion(queue, shape)),
      color(queue, shape.sh_degree),
      parameters(queue, count, model_groups(shape), motion_tables(shape), moving,
                 purpose == Purpose::training) {}

Model::Model(Queue& queue, const HostModel& host, Purpose purpose)
    : Model(queue, host.shape, host.count, purpose, host.num_moving()) {
  const auto set = [&](ParameterGroup& group, const GroupSpec& spec, size_t blocks, size_t rows,
                       bool for_some) {
    const size_t size = spec.width * rows;
    const auto found = host.groups.find(spec.name);
    if (found == host.groups.end() || found->second.size() != size)
      throw Error(fmt::format("a model of {} Gaussians needs {} values of {}", host.count, size,
                              spec.name));
    group.values.write(queue, for_some ? for_moving(found->second, blocks, parameters.moving,
                                                    host.count, spec.width)
                                       : found->second);
  };
  const bool some_static = parameters.moving < parameters.count;
  for (size_t g = 0; g < parameters.specs.size(); ++g)
    set(parameters.groups[g], parameters.specs[g], 1, host.count,
        some_static && parameters.specs[g].moving);
  for (size_t t = 0; t < parameters.more.size(); ++t) {
    const TableSpec& table = parameters.more_specs[t];
    for (size_t g = 0; g < table.groups.size(); ++g)
      set(parameters.more[t].groups[g], table.groups[g], table.keys, table.count(host.count),
          some_static && table.keys > 0);
  }
}

HostModel Model::read(Queue& queue) const {
  HostGroups values;
  for (const Table* table : parameters.tables())
    for (size_t g = 0; g < table->specs.size(); ++g)
      values[table->specs[g].name] = table->groups[g].values.read(queue);
  return model_of_values(shape, parameters.count, parameters.moving, std::move(values));
}

void Model::step(Queue& queue, Adam& adam, const AdamRate& rate) {
  for (Table* table : parameters.tables()) {
    for (size_t g = 0; g < table->groups.size(); ++g)
      adam.refuse(queue, table->groups[g], table->rows, table->active_in(table->specs[g]));
    adam.advance(queue, table->rows, table->active);
    for (size_t g = 0; g < table->groups.size(); ++g)
      adam.step(queue, table->groups[g], table->rows, table->active_in(table->specs[g]), rate);
  }
}

HostModel model_of_state(const ModelShape& shape, const Arrays& arrays, const std::string& path) {
  StateValues kept = state_values(arrays, model_groups(shape), motion_tables(shape), path);
  return model_of_values(shape, kept.count, kept.moving, std::move(kept.groups));
}

void write_model(const std::string& path, const HostModel& model) {
  const size_t rest = size_t((model.shape.sh_degree + 1) * (model.shape.sh_degree + 1) - 1);
  PlyTable table;
  table.rows = model.count;
  const MotionModelKind kind = model.shape.motion;
  table.comments = {std::string("gflow ") + name_of(kind)};
  MotionShape::fields(model.shape, [&](const char* name, auto value, double, double) {
    table.comments.push_back(fmt::format("{} {}", name, value));
  });
  const auto& [x, y, z] = model.shape.origin;
  if (x != 0 || y != 0 || z != 0) table.comments.push_back(fmt::format("origin {} {} {}", x, y, z));
  table.names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  const auto append = [&](const std::vector<std::string>& names) {
    table.names.insert(table.names.end(), names.begin(), names.end());
  };
  append(numbered("f_rest_", 3 * rest));
  append({"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"});
  append({"t", "scale_t"});
  const bool some_static = stores_moves(model);
  if (some_static) append({moves_property});
  for (const MotionColumns& motion : motion_columns(model.shape)) append(motion.properties);
  struct Source {
    const std::vector<float>& values;
    size_t width, first, count, to;
  };
  std::vector<Source> sources;
  const auto widths = widths_of(model.shape);
  for (const ColumnBlock& block : column_blocks(true, model.shape))
    sources.push_back({model.groups.at(block.group), widths.at(block.group), block.first,
                       block.names.size(), size_t(table.column(block.names[0]))});
  const float* sh_rest = rest ? model.groups.at("sh_rest").data() : nullptr;
  const size_t to_rest = rest ? size_t(table.column("f_rest_0")) : 0;
  const size_t to_moves = some_static ? size_t(table.column(moves_property)) : 0;
  write_tables(tables_path(path), model);
  write_ply(path, table, [&](size_t i, float* row) {
    std::fill_n(row, table.names.size(), 0.f);  // normals
    for (const Source& from : sources)
      std::copy_n(&from.values[i * from.width + from.first], from.count, row + from.to);
    for (size_t k = 0; k < rest; ++k)
      for (size_t c = 0; c < 3; ++c) row[to_rest + c * rest + k] = sh_rest[(i * rest + k) * 3 + c];
    if (some_static) row[to_moves] = i < model.moving ? 1 : 0;
  });
}

namespace {

// Warns of Gaussians whose scales overflow a float: they are not drawn.
void warn_of_scales(const HostModel& model, const std::string& path) {
  const std::vector<float>& log_scales = model.groups.at("log_scales");
  size_t too_large = 0;
  for (size_t i = 0; i < model.count; ++i) {
    const float* s = &log_scales[4 * i];
    too_large += !std::isfinite(std::exp(std::max({s[0], s[1], s[2]})));
  }
  if (too_large > 0)
    warn_once(
        fmt::format("{} of the Gaussians in {} have scales too large for a float and are not drawn",
                    too_large, path));
}

}  // namespace

HostModel read_model(const std::string& path, Undrawable undrawable) {
  PlyTable table = read_splats(path, undrawable);
  HostModel model;
  model.count = table.rows;
  const auto has = [&](const char* name) { return table.column(name) >= 0; };
  const MotionModelKind kind = kind_of(table, path);
  const bool moving = has("scale_t") || has("rot_r_0") || has("motion_0");
  model.moving = put_moving_first(table);
  model.shape.motion = kind;
  model.shape.sh_degree = sh_degree_of(table, path);
  MotionShape::fields(model.shape,
                      [&](const char* name, auto& value, double lowest, double highest) {
                        read_comment(table, name, value, lowest, highest, path);
                      });

  for (const ColumnBlock& block : column_blocks(moving, model.shape))
    for (const std::string& name : block.names) require_property(table.names, name, path);
  model.shape.origin = origin_of(table, path);
  const auto widths = widths_of(model.shape);
  const size_t columns = table.names.size();
  for (const ColumnBlock& block : column_blocks(moving, model.shape)) {
    const size_t width = widths.at(block.group);
    std::vector<float>& values = model.groups[block.group];
    values.resize(width * model.count);
    for (size_t c = 0; c < block.names.size(); ++c) {
      const size_t from = size_t(table.column(block.names[c]));
      for (size_t i = 0; i < table.rows; ++i)
        values[i * width + block.first + c] = table.values[i * columns + from];
    }
  }
  const size_t rest = size_t((model.shape.sh_degree + 1) * (model.shape.sh_degree + 1) - 1);
  std::vector<float>& sh_rest = model.groups["sh_rest"];
  sh_rest.resize(3 * rest * model.count);
  for (size_t k = 0; k < rest; ++k)
    for (size_t c = 0; c < 3; ++c) {
      const size_t from = size_t(table.column("f_rest_" + std::to_string(c * rest + k)));
      for (size_t i = 0; i < table.rows; ++i)
        sh_rest[(i * rest + k) * 3 + c] = table.values[i * columns + from];
    }
  table.values = std::vector<float>();      // `= {}` would keep its memory
  for (const auto& [name, width] : widths)  // groups that the file lacks
    model.groups[name].resize(width * model.count);
  if (moving) read_tables(tables_path(path), model);
  if (!moving) {  // static scenes last for the whole video
    set_static(model.shape, model.groups, model.count);
    for (size_t i = 0; i < model.count; ++i) {
      model.groups["log_scales"][4 * i + 3] = std::log(1000 * model.shape.duration);
      model.groups["means_t"][i] = model.shape.duration / 2;
    }
  }
  for (const auto& [name, values] : model.groups)
    for (size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i]))
        throw Error(fmt::format("reading {}: Gaussian {} has NaN or Inf in {}", path,
                                model.count ? i * model.count / values.size() : 0, name));
  warn_of_scales(model, path);
  return model;
}

bool is_static_model(const HostModel& model) {
  const std::vector<float>& log_scales = model.groups.at("log_scales");
  for (size_t i = 0; i < model.count; ++i)
    if (log_scales[4 * i + 3] < std::log(100 * model.shape.duration)) return false;
  return is_static(model.shape, model.groups);
}

}  // namespace gflow
