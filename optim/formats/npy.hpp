// SPDX-License-Identifier: Apache-2.0
// NumPy arrays in memory and as .npy bytes (format 1.0, 2.0 and 3.0; little-endian, C order).
// Booleans are held as uint8_t, 0 or 1, and written back as u1.
#pragma once
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

// An n-dimensional array; the last index runs fastest. An empty shape is one scalar.
struct Array {
  using Values = std::variant<std::vector<float>, std::vector<double>, std::vector<int8_t>,
                              std::vector<uint8_t>, std::vector<int16_t>, std::vector<uint16_t>,
                              std::vector<int32_t>, std::vector<uint32_t>, std::vector<int64_t>>;

  std::vector<size_t> shape;
  Values values;  // as many as the product of shape

  // Number of elements.
  size_t size() const;
  // Elements converted one by one as static_cast does.
  std::vector<float> as_float() const;
  std::vector<double> as_double() const;
  std::vector<int32_t> as_int() const;
  // Shape as NumPy prints it: (3, 4), (5,) or ().
  std::string shape_text() const;
};

// One array from the bytes of a .npy file; `name` is the file named in errors. Refused: Fortran
// order, big-endian, other element types, and any file whose length is not what its header says.
Array parse_npy(const uint8_t* bytes, size_t length, const std::string& name);

// Bytes of the .npy file that begins like this, by its header. Error as parse_npy's.
size_t npy_length(const uint8_t* bytes, size_t length, const std::string& name);

// The bytes of a .npy file (format 1.0). Error when shape and number of values disagree.
Bytes npy_bytes(const Array& array);

Array read_npy(const std::string& path);  // also gzipped
void write_npy(const std::string& path, const Array& array);

}  // namespace gflow
