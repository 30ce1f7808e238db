// SPDX-License-Identifier: Apache-2.0
// NumPy arrays in memory and as .npy bytes (format 1.0, 2.0 and 3.0; little-endian).
// Booleans are read as uint8_t, 0 or 1, and written back as u1; f2 is read as float. Arrays in
// Fortran order are read into C order.
#pragma once
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

// An n-dimensional array in C order. An empty shape is a scalar.
struct Array {
  using Values = std::variant<std::vector<float>, std::vector<double>, std::vector<int8_t>,
                              std::vector<uint8_t>, std::vector<int16_t>, std::vector<uint16_t>,
                              std::vector<int32_t>, std::vector<uint32_t>, std::vector<int64_t>>;

  std::vector<size_t> shape;
  Values values;  // [product of shape]

  size_t size() const;
  // Elements converted by static_cast.
  std::vector<float> as_float() const;
  std::vector<double> as_double() const;
  std::vector<int32_t> as_int() const;
  // Shape as NumPy prints it: (3, 4), (5,) or ().
  std::string shape_text() const;
};

// Parses the bytes of a .npy file; `name` names it in errors. Error for big-endian data, other
// element types, and a length that differs from the header's.
Array parse_npy(const uint8_t* bytes, size_t length, const std::string& name);

// Length [bytes] of a .npy file from its first bytes, which contain the header. Errors as
// parse_npy.
size_t npy_length(const uint8_t* bytes, size_t length, const std::string& name);

// The bytes of a .npy file (format 1.0). Error if shape and number of values disagree.
Bytes npy_bytes(const Array& array);

Array read_npy(const std::string& path);  // also gzipped
void write_npy(const std::string& path, const Array& array);

}  // namespace gflow
