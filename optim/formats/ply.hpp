// SPDX-License-Identifier: Apache-2.0
// PLY files: point clouds, and tables of float properties such as trained Gaussians. Reads ASCII
// and binary of either byte order; skips other elements (faces, chunks) and unused properties. Row
// counts are checked against the file length before memory is allocated.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace gflow {

// Largest accepted coordinate: its square must be finite in float.
constexpr double farthest_point = 1e18;

// Coloured points. rgb is as long as xyz, or empty if the file has no colours.
struct PointCloud {
  std::vector<double> xyz;   // [n, 3] world
  std::vector<uint8_t> rgb;  // [n, 3]
  std::string source = "";   // path of the file they were read from, or empty
  size_t size() const { return xyz.size() / 3; }
};

// The scalar properties of element "vertex" as floats.
struct PlyTable {
  std::vector<std::string> names;  // column names in the file's order
  size_t rows = 0;
  std::vector<float> values;          // [rows, names]
  std::vector<std::string> comments;  // without the word "comment"
  // Added to x, y and z. Not zero if the file has them as doubles, because floats far from 0 cannot
  // separate neighbours.
  std::array<double, 3> origin = {0, 0, 0};

  // Index of a column, or -1.
  int column(const std::string& name) const;
  // Values of a column, [rows]. Error if there is no such column.
  std::vector<float> column_values(const std::string& name) const;
};

// Error if the file is missing or truncated, if it has no element "vertex", or if a property of
// "vertex" is a list.
PlyTable read_ply(const std::string& path);

// Names of the properties of element "vertex"; empty if there is none. Reads only the header.
std::vector<std::string> ply_vertex_properties(const std::string& path);

// Whether a property of element "vertex" is a float or double, not an integer. Reads only the
// header; false if there is no such property.
bool is_real_property(const std::string& path, const std::string& name);

// Binary little-endian. All properties are float; x, y and z are double if origin is not zero.
void write_ply(const std::string& path, const PlyTable& table);

// Puts row i of a table into `values`, [names]. Called once per row, in order.
using PlyRow = std::function<void(size_t i, float* values)>;
// Writes rows as they are computed; `head` is the table without its values.
void write_ply(const std::string& path, const PlyTable& head, const PlyRow& row);

// One element of a PLY with its scalar properties. Reals are stored as floats and integers exactly,
// because packed 32-bit words would be rounded by a float.
struct PlyElement {
  std::string name;
  std::vector<std::string> properties;
  std::vector<bool> reals;      // [properties]; true: a real type
  std::vector<bool> is_32_bit;  // [properties]; true: a 32-bit integer
  size_t rows = 0;
  std::vector<uint32_t> words;  // [rows, properties]; float bits, or integers modulo 2^32

  // Index of a property, or -1.
  int property(const std::string& name) const;
  // A value as double; integers are read as unsigned.
  double value(size_t row, size_t property) const;
};

// All elements in the file's order. Errors as read_ply, but a list in any element is an error and
// "vertex" is not required.
std::vector<PlyElement> read_ply_elements(const std::string& path);

// Limit on points kept, more than any training starts with: points of a short ASCII file take five
// times its size in memory.
constexpr size_t most_points = 3000000;

// The value of full intensity in real colours, by the largest in the file: 1, or 255 if that is
// well above 1. Rounding errors may exceed 1 slightly.
inline double full_intensity(double largest) { return largest > 1.5 ? 255 : 1; }

// Reads x y z and, if present, the colours: red green blue, diffuse_red diffuse_green diffuse_blue,
// or r g b, integers 0..255 or reals 0..1 or 0..255 (full_intensity); else f_dc_0..2 of trained
// Gaussians. Keeps at most most_points, evenly chosen. Error if a coordinate is not finite or above
// farthest_point.
PointCloud read_point_cloud(const std::string& path);

// Warns of points with a coordinate that is NaN, infinite or beyond farthest_point. Error if these
// are all.
void report_left_out_points(size_t count, size_t all, const std::string& path);

// Binary little-endian: float x y z, and uchar red green blue if there are colours.
void write_point_cloud(const std::string& path, const PointCloud& points);

}  // namespace gflow
