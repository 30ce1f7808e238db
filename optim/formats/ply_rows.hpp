// SPDX-License-Identifier: Apache-2.0
// Reads the header of a PLY and its rows as streams of values.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "runtime/files/file_pieces.hpp"

namespace gflow {

enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };
inline bool is_real(PlyType type) { return type == PlyType::f32 || type == PlyType::f64; }

struct PlyProperty {
  std::string name;
  PlyType type;
  bool is_list = false;
  PlyType length_type = PlyType::u8;  // of a list's length
};

struct PlyElementHeader {
  std::string name;
  size_t rows = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool ascii = false, big_endian = false;
  std::vector<PlyElementHeader> elements;
  std::vector<std::string> comments;  // without the word "comment"
};

// Throws "cannot read PLY PATH: why".
[[noreturn]] void throw_ply_error(const std::string& path, const std::string& why);

// Reads a PLY piece by piece. Elements must be read or skipped in the file's order. Errors name the
// place in the file.
class PlyRows {
 public:
  // Error if the file is missing or has no valid PLY header.
  explicit PlyRows(const std::string& path);

  const PlyHeader& header() const { return header_; }

  // Error if the rest of the file is too short for the rows of an element, or the element has a
  // list. Call before allocating memory for the rows.
  void require_rows(const PlyElementHeader& element) const;

  // Calls row(const double* values) per row, values [properties]. Calls require_rows first. Error
  // if the element is the last one and the file goes on after it.
  template <class Row>
  void read(const PlyElementHeader& element, Row&& row) {
    require_rows(element);
    std::vector<double> values(element.properties.size());
    for (size_t i = 0; i < element.rows; ++i) {
      for (size_t c = 0; c < values.size(); ++c) values[c] = next(element.properties[c].type);
      end_row();
      row(values.data());
    }
    if (&element == &header_.elements.back()) require_end();
  }

  void skip(const PlyElementHeader& element);

 private:
  double next(PlyType type) { return header_.ascii ? next_word() : next_binary(type); }
  double next_word();
  double next_binary(PlyType type);
  template <class T>
  double take();
  void end_row();
  void require_end();
  void step_over_blanks();
  void skip_fixed(const PlyElementHeader& element);
  [[noreturn]] void truncated() const;
  [[noreturn]] void refuse_word(std::string_view text, const char* what) const;

  FilePieces file_;
  PlyHeader header_;
  bool in_row_ = false;  // ASCII: after the first value of a row
};

}  // namespace gflow
