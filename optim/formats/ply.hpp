// SPDX-License-Identifier: Apache-2.0
// PLY files: point clouds to start from, and tables of float properties such as trained Gaussians.
// ASCII and binary little-endian are read; other elements (faces, chunks) and extra properties are
// stepped over. Numbers of rows are compared with the file's length before memory is taken.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace gflow {

// Places farther from the origin are refused: the square of a float must be one.
constexpr double farthest_point = 1e18;

// Coloured points. rgb is either as long as xyz or empty when the file has no colours.
struct PointCloud {
  std::vector<double> xyz;   // [n, 3] world
  std::vector<uint8_t> rgb;  // [n, 3]
  size_t size() const { return xyz.size() / 3; }
};

// The scalar properties of element "vertex", each value as float, row by row.
struct PlyTable {
  std::vector<std::string> names;  // column names in the file's order
  size_t rows = 0;
  std::vector<float> values;          // [rows, names]
  std::vector<std::string> comments;  // header comments without the word "comment"
  // What x, y and z are relative to, where the file has them as doubles: far from 0 a float would
  // not tell neighbours apart.
  std::array<double, 3> origin = {0, 0, 0};

  // Index of a column, or -1.
  int column(const std::string& name) const;
  // All values of a column. Error when there is no such column.
  std::vector<float> column_values(const std::string& name) const;
};

// Error when the file is missing, truncated, big-endian, has no element "vertex", or a property
// of vertex that is a list.
PlyTable read_ply(const std::string& path);

// The properties of element "vertex" by name; empty when there is no such element. Reads the
// header.
std::vector<std::string> ply_vertex_properties(const std::string& path);

// Binary little-endian, all properties float; x, y and z double where they have an origin.
void write_ply(const std::string& path, const PlyTable& table);

// The values of row i of a table, [names], put into `values`: asked for in order, once each.
using PlyRow = std::function<void(size_t i, float* values)>;
// The same of rows that are made while they are written; `head` has all but the values.
void write_ply(const std::string& path, const PlyTable& head, const PlyRow& row);

// One element of a PLY with its scalar properties: reals as floats, integers exactly (also 32 bits
// that hold something packed, which a float would round).
struct PlyElement {
  std::string name;
  std::vector<std::string> properties;
  std::vector<bool> reals;        // [properties] whether it is a float
  std::vector<bool> words_of_32;  // [properties] whether it is an integer of 32 bits
  size_t rows = 0;
  std::vector<uint32_t> words;  // [rows, properties] the bits of each, integers modulo 2^32

  // Index of a property, or -1.
  int property(const std::string& name) const;
  // A value; integers as if they had no sign.
  double value(size_t row, size_t property) const;
};

// Every element, in the file's order. Errors as read_ply, but lists are refused in all of them and
// no element is demanded.
std::vector<PlyElement> read_ply_elements(const std::string& path);

// No training begins with as many points: of more in a text of a few bytes each, the points would
// take five times the file.
constexpr size_t most_points = 3000000;

// x y z and, when present, red green blue (uchar 0..255, or float 0..1); of more than most_points
// so many, evenly chosen. Error on positions that are not finite.
PointCloud read_point_cloud(const std::string& path);

// Binary little-endian, x y z float and red green blue uchar when there are colours.
void write_point_cloud(const std::string& path, const PointCloud& points);

}  // namespace gflow
