// SPDX-License-Identifier: Apache-2.0
// PLY: a text header with elements and their properties, then the rows of each element. read_ply
// keeps element "vertex": elements before it are skipped, elements after it are not read.
#include "optim/formats/ply.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "optim/formats/ply_rows.hpp"
#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

const PlyElementHeader* vertices_of(const PlyHeader& header) {
  for (const PlyElementHeader& element : header.elements)
    if (element.name == "vertex") return &element;
  return nullptr;
}

// Skips the elements before "vertex". Error if there is no "vertex".
const PlyElementHeader& find_vertices(PlyRows& rows, const std::string& path) {
  const PlyElementHeader* vertices = vertices_of(rows.header());
  if (!vertices) throw_ply_error(path, "it has no element 'vertex'");
  for (const PlyElementHeader* before = rows.header().elements.data(); before != vertices; ++before)
    rows.skip(*before);
  rows.require_rows(*vertices);
  return *vertices;
}

std::vector<std::string> names_of(const PlyElementHeader& element) {
  std::vector<std::string> names;
  for (const PlyProperty& property : element.properties) names.push_back(property.name);
  return names;
}

// Index of a name, or -1.
int find(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : int(found - names.begin());
}

std::array<int, 3> find_each(const std::vector<std::string>& names,
                             const std::array<const char*, 3>& three) {
  return {find(names, three[0]), find(names, three[1]), find(names, three[2])};
}

// Whether all of these columns exist and are doubles.
bool are_doubles(const PlyElementHeader& element, const std::array<int, 3>& columns) {
  return std::all_of(columns.begin(), columns.end(), [&](int column) {
    return column >= 0 && element.properties[size_t(column)].type == PlyType::f64;
  });
}

// An integer modulo 2^32; 0 for a value outside of 64-bit integers, possible in text.
uint32_t integer_bits(double value) {
  return std::abs(value) < 9e18 ? uint32_t(int64_t(value)) : 0;
}

// Mean of the finite positions, rounded to whole units. A second pass over the file needs less
// memory than keeping the positions as doubles.
std::array<double, 3> middle_of(const std::string& path, const std::array<int, 3>& position) {
  std::array<double, 3> middle = {0, 0, 0}, sum = {0, 0, 0}, count = {0, 0, 0};
  PlyRows rows(path);
  rows.read(find_vertices(rows, path), [&](const double* values) {
    for (size_t axis = 0; axis < 3; ++axis)
      if (const double place = values[position[axis]]; std::isfinite(place))
        sum[axis] += place, ++count[axis];
  });
  for (size_t axis = 0; axis < 3; ++axis)
    if (count[axis] > 0 && std::isfinite(sum[axis]))
      middle[axis] = std::round(sum[axis] / count[axis]);
  return middle;
}

template <class T>
void append(std::string& bytes, const T* values, size_t n) {
  bytes.append(reinterpret_cast<const char*>(values), n * sizeof(T));
}

constexpr std::array<const char*, 3> kHarmonics = {"f_dc_0", "f_dc_1", "f_dc_2"};

// The columns of colours by the names that programs use; those of trained Gaussians last, because
// they are not colours but harmonics. -1 each if there are none.
std::array<int, 3> find_colors(const std::vector<std::string>& names) {
  constexpr std::array<std::array<const char*, 3>, 4> known = {
      {{"red", "green", "blue"},
       {"diffuse_red", "diffuse_green", "diffuse_blue"},
       {"r", "g", "b"},
       kHarmonics}};
  for (const auto& three : known)
    if (const auto columns = find_each(names, three);
        std::all_of(columns.begin(), columns.end(), [](int column) { return column >= 0; }))
      return columns;
  return {-1, -1, -1};
}

// Value of full intensity of each colour column. Real colours need a second pass over the file.
std::array<double, 3> full_intensities(const std::string& path, const PlyElementHeader& vertices,
                                       const std::array<int, 3>& color) {
  const auto real = [&](int column) { return is_real(vertices.properties[size_t(column)].type); };
  const auto full_of_integers = [&](int column) {
    return vertices.properties[size_t(column)].type == PlyType::u16 ? 65535. : 255.;
  };
  if (std::none_of(color.begin(), color.end(), real))
    return {full_of_integers(color[0]), full_of_integers(color[1]), full_of_integers(color[2])};
  double largest = 0;
  PlyRows rows(path);
  rows.read(find_vertices(rows, path), [&](const double* values) {
    for (const int column : color)
      if (real(column) && std::isfinite(values[column]))
        largest = std::max(largest, values[column]);
  });
  std::array<double, 3> full{};
  for (size_t i = 0; i < 3; ++i) full[i] = real(color[i]) ? full_intensity(largest) : 255;
  return full;
}

uint8_t color_byte(double value) {
  return uint8_t(std::isfinite(value) ? std::clamp(value + .5, 0., 255.) : 0.);
}

}  // namespace

int PlyTable::column(const std::string& name) const { return find(names, name); }

std::vector<float> PlyTable::column_values(const std::string& name) const {
  const int c = column(name);
  if (c < 0) throw Error(fmt::format("the PLY table has no property '{}'", name));
  std::vector<float> result(rows);
  for (size_t row = 0; row < rows; ++row) result[row] = values[row * names.size() + size_t(c)];
  return result;
}

std::vector<std::string> ply_vertex_properties(const std::string& path) {
  const PlyRows rows(path);
  const PlyElementHeader* vertices = vertices_of(rows.header());
  return vertices ? names_of(*vertices) : std::vector<std::string>();
}

bool is_real_property(const std::string& path, const std::string& name) {
  const PlyRows rows(path);
  const PlyElementHeader* vertices = vertices_of(rows.header());
  const int column = vertices ? find(names_of(*vertices), name) : -1;
  return column >= 0 && is_real(vertices->properties[size_t(column)].type);
}

PlyTable read_ply(const std::string& path) {
  PlyRows rows(path);
  const PlyElementHeader& vertices = find_vertices(rows, path);
  PlyTable table;
  table.comments = rows.header().comments;
  table.names = names_of(vertices);
  table.rows = vertices.rows;
  const size_t columns = table.names.size();
  const std::array<int, 3> position = find_each(table.names, {"x", "y", "z"});
  const bool exact = are_doubles(vertices, position);
  if (exact) table.origin = middle_of(path, position);
  table.values.reserve(table.rows * columns);
  rows.read(vertices, [&](const double* values) {
    table.values.insert(table.values.end(), values, values + columns);
    float* const row = table.values.data() + table.values.size() - columns;
    for (size_t axis = 0; axis < 3 && exact; ++axis)
      row[position[axis]] = float(values[position[axis]] - table.origin[axis]);
  });
  return table;
}

int PlyElement::property(const std::string& name) const { return find(properties, name); }

double PlyElement::value(size_t row, size_t property) const {
  const uint32_t bits = words[row * properties.size() + property];
  float real;
  std::memcpy(&real, &bits, sizeof real);
  return reals[property] ? double(real) : double(bits);
}

std::vector<PlyElement> read_ply_elements(const std::string& path) {
  PlyRows rows(path);
  std::vector<PlyElement> elements;
  for (const PlyElementHeader& header : rows.header().elements) {
    PlyElement element{header.name, names_of(header), {}, {}, header.rows, {}};
    for (const PlyProperty& property : header.properties) {
      element.reals.push_back(is_real(property.type));
      element.is_32_bit.push_back(property.type == PlyType::u32 || property.type == PlyType::i32);
    }
    rows.require_rows(header);
    element.words.reserve(header.rows * header.properties.size());
    rows.read(header, [&](const double* values) {
      for (size_t c = 0; c < element.reals.size(); ++c) {
        const float real = float(values[c]);
        uint32_t bits = integer_bits(values[c]);
        if (element.reals[c]) std::memcpy(&bits, &real, sizeof bits);
        element.words.push_back(bits);
      }
    });
    elements.push_back(std::move(element));
  }
  return elements;
}

void write_ply(const std::string& path, const PlyTable& table) {
  const size_t columns = table.names.size();
  if (columns == 0 || table.values.size() != table.rows * columns)
    throw Error(fmt::format("cannot write {}: {} rows of {} properties do not match {} values",
                            path, table.rows, columns, table.values.size()));
  write_ply(path, table, [&](size_t i, float* values) {
    std::copy_n(table.values.data() + i * columns, columns, values);
  });
}

void write_ply(const std::string& path, const PlyTable& head, const PlyRow& row) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : head.comments) bytes += fmt::format("comment {}\n", comment);
  bytes += fmt::format("element vertex {}\n", head.rows);
  const bool far = head.origin != std::array<double, 3>{0, 0, 0};
  std::vector<int> axes;  // per column: its axis if the values are doubles, else -1
  for (const std::string& name : head.names) {
    const bool position = far && (name == "x" || name == "y" || name == "z");
    axes.push_back(position ? name[0] - 'x' : -1);
    bytes += fmt::format("property {} {}\n", position ? "double" : "float", name);
  }
  bytes += "end_header\n";
  std::vector<float> values(head.names.size());
  write_file_in_pieces(path, [&](const Append& write) {
    for (size_t i = 0; i < head.rows; ++i) {
      row(i, values.data());
      if (!far) append(bytes, values.data(), values.size());
      for (size_t c = 0; c < values.size() && far; ++c) {
        const int axis = axes[c];
        const double place = axis < 0 ? 0 : double(values[c]) + head.origin[size_t(axis)];
        if (axis < 0)
          append(bytes, &values[c], 1);
        else
          append(bytes, &place, 1);
      }
      write(bytes);
      bytes.clear();
    }
    write(bytes);  // header of a table without rows
  });
}

void report_left_out_points(size_t count, size_t all, const std::string& path) {
  if (count == 0) return;
  const std::string what = fmt::format(
      "{} of the {} points in {} have a coordinate that is NaN, infinite or beyond {:g}", count,
      all, path, farthest_point);
  if (count == all) throw Error("cannot read the points: " + what);
  warn_once(what + " and are left out");
}

PointCloud read_point_cloud(const std::string& path) {
  PlyRows rows(path);
  const PlyElementHeader& vertices = find_vertices(rows, path);
  const std::vector<std::string> names = names_of(vertices);
  const std::array<int, 3> position = find_each(names, {"x", "y", "z"});
  const std::array<int, 3> color = find_colors(names);
  if (std::any_of(position.begin(), position.end(), [](int column) { return column < 0; }))
    throw_ply_error(path, "its vertices have no x, y and z");
  const bool colored = color[0] >= 0;
  const bool harmonics = colored && names[size_t(color[0])] == kHarmonics[0];
  std::array<double, 3> full{};
  if (colored && !harmonics) full = full_intensities(path, vertices, color);
  const bool exact = are_doubles(vertices, position);
  PointCloud points;
  points.source = path;
  const size_t count = std::min(vertices.rows, most_points);
  points.xyz.reserve(3 * count);
  if (colored) points.rgb.reserve(3 * count);
  size_t vertex = 0, left_out = 0;
  rows.read(vertices, [&](const double* values) {
    const size_t v = vertex++;
    const bool wanted = double(v) * double(count) >= double(points.size()) * double(vertices.rows);
    const bool placed = std::all_of(position.begin(), position.end(), [&](int column) {
      return std::fabs(values[column]) <= farthest_point;
    });
    left_out += !placed;
    const bool kept = wanted && placed;
    for (size_t i = 0; i < 3 && kept; ++i) {
      const double place = values[position[i]];
      points.xyz.push_back(exact ? place : double(float(place)));
    }
    for (size_t i = 0; i < 3 && colored && kept; ++i) {
      const double value = values[color[i]];
      points.rgb.push_back(color_byte(255 * (harmonics ? color_of_sh0(value) : value / full[i])));
    }
  });
  report_left_out_points(left_out, vertices.rows, path);
  return points;
}

void write_point_cloud(const std::string& path, const PointCloud& points) {
  const bool colored = !points.rgb.empty();
  if (points.xyz.size() % 3 || (colored && points.rgb.size() != points.xyz.size()))
    throw Error(fmt::format("cannot write {}: {} coordinates do not match {} colour values", path,
                            points.xyz.size(), points.rgb.size()));
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n{}end_header\n",
      points.size(),
      colored ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "");
  write_file_in_pieces(path, [&](const Append& write) {
    for (size_t i = 0; i < points.size(); ++i) {
      const float place[3] = {float(points.xyz[3 * i]), float(points.xyz[3 * i + 1]),
                              float(points.xyz[3 * i + 2])};
      append(bytes, place, 3);
      if (colored) append(bytes, points.rgb.data() + 3 * i, 3);
      write(bytes);
      bytes.clear();
    }
    write(bytes);  // header of an empty point cloud
  });
}

}  // namespace gflow
