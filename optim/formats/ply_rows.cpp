// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/ply_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <map>
#include <set>
#include <sstream>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {

void throw_ply_error(const std::string& path, const std::string& why) {
  throw Error(fmt::format("cannot read PLY {}: {}", path, why));
}

namespace {

constexpr size_t longest_header = size_t{1} << 20;  // headers have a few dozen lines
constexpr size_t longest_word = size_t{1} << 12;    // numbers have a few dozen characters

size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::i8:
    case PlyType::u8:
      return 1;
    case PlyType::i16:
    case PlyType::u16:
      return 2;
    case PlyType::f64:
      return 8;
    default:
      return 4;
  }
}

PlyType parse_type(const std::string& word, const std::string& path) {
  static const std::map<std::string, PlyType> types = {
      {"char", PlyType::i8},    {"int8", PlyType::i8},     {"uchar", PlyType::u8},
      {"uint8", PlyType::u8},   {"short", PlyType::i16},   {"int16", PlyType::i16},
      {"ushort", PlyType::u16}, {"uint16", PlyType::u16},  {"int", PlyType::i32},
      {"int32", PlyType::i32},  {"uint", PlyType::u32},    {"uint32", PlyType::u32},
      {"float", PlyType::f32},  {"float32", PlyType::f32}, {"double", PlyType::f64},
      {"float64", PlyType::f64}};
  const auto found = types.find(word);
  if (found == types.end())
    throw_ply_error(path, fmt::format("'{}' is not a property type", excerpt(word)));
  return found->second;
}

PlyProperty parse_property(std::istringstream& words, const std::string& path) {
  PlyProperty property{};
  std::string type;
  words >> type;
  if (type == "list") {
    property.is_list = true;
    words >> type;
    property.length_type = parse_type(type, path);
    words >> type;
  }
  property.type = parse_type(type, path);
  if (!(words >> property.name)) throw_ply_error(path, "a property in its header has no name");
  return property;
}

// Parses one header line; true if it was "end_header".
bool parse_line(const std::string& line, PlyHeader& header, bool& has_format,
                const std::string& path) {
  std::istringstream words(line);
  std::string keyword, word;
  words >> keyword;
  if (keyword == "format") {
    words >> word;
    if (word != "ascii" && word != "binary_little_endian" && word != "binary_big_endian")
      throw_ply_error(path, fmt::format("its format is '{}', expected ascii, binary_little_endian "
                                        "or binary_big_endian",
                                        excerpt(word)));
    std::string version;
    if (!(words >> version) || version != "1.0" || !(words >> std::ws).eof())
      throw_ply_error(path,
                      fmt::format("its line '{}' must end with the version 1.0", excerpt(line)));
    if (has_format) throw_ply_error(path, "its header has two lines 'format'");
    header.ascii = word == "ascii";
    header.big_endian = word == "binary_big_endian";
    has_format = true;
  } else if (keyword == "element") {
    PlyElementHeader element;
    long long rows = -1;
    words >> element.name >> rows;
    if (!words || rows < 0 || !(words >> std::ws).eof())
      throw_ply_error(path,
                      fmt::format("its line '{}' has no valid number of rows", excerpt(line)));
    element.rows = size_t(rows);
    header.elements.push_back(element);
  } else if (keyword == "property") {
    if (header.elements.empty()) throw_ply_error(path, "a property comes before any element");
    header.elements.back().properties.push_back(parse_property(words, path));
  } else if (keyword == "comment") {
    header.comments.push_back(line.size() > 8 ? line.substr(8) : "");
  } else if (keyword == "end_header") {
    return true;
  } else if (!keyword.empty() && keyword != "obj_info") {
    throw_ply_error(path, fmt::format("its header line '{}' is unknown", excerpt(line)));
  }
  return false;
}

PlyHeader parse_header(FilePieces& file) {
  const std::string& path = file.path();
  const std::string_view text = file.ahead(longest_header);
  const size_t first = std::min(text.find_first_of("\r\n"), text.size());
  const size_t word = std::min(text.find_first_of(" \t"), first);
  if (text.substr(0, word) != "ply" ||
      text.substr(word, first - word).find_first_not_of(" \t") != text.npos)
    throw_ply_error(path, "it does not begin with a line 'ply'");
  PlyHeader header;
  bool has_format = false, ended = false;
  size_t at = text.find('\n');
  while (!ended) {
    const size_t end = at == text.npos ? at : text.find('\n', at + 1);
    if (end == text.npos)
      throw_ply_error(path, file.left() < longest_header
                                ? "it has no line 'end_header'"
                                : "it has no line 'end_header' within its first MB");
    std::string line(text.substr(at + 1, end - at - 1));
    if (!line.empty() && line.back() == '\r') line.pop_back();
    ended = parse_line(line, header, has_format, path);
    at = end;
  }
  if (!has_format) throw_ply_error(path, "its header has no line 'format'");
  std::set<std::string> elements;
  for (const PlyElementHeader& element : header.elements) {
    if (!elements.insert(element.name).second)
      throw_ply_error(path,
                      fmt::format("its header has the element '{}' twice", excerpt(element.name)));
    std::set<std::string> names;
    for (const PlyProperty& property : element.properties)
      if (!names.insert(property.name).second)
        throw_ply_error(path, fmt::format("its element '{}' has the property '{}' twice",
                                          excerpt(element.name), excerpt(property.name)));
  }
  file.step(at + 1);
  return header;
}

// Separates words of ASCII data; NUL is not a blank.
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

}  // namespace

PlyRows::PlyRows(const std::string& path) : file_(path), header_(parse_header(file_)) {}

// In ASCII each value but the last takes at least two bytes, a digit and a space.
void PlyRows::require_rows(const PlyElementHeader& element) const {
  size_t stride = 0;
  for (const PlyProperty& property : element.properties) {
    if (property.is_list)
      throw_ply_error(file_.path(), fmt::format("property '{}' of {} is a list, expected a number",
                                                excerpt(property.name), excerpt(element.name)));
    stride += header_.ascii ? 2 : size_of(property.type);
  }
  if (!stride)
    throw_ply_error(file_.path(),
                    fmt::format("its element '{}' has no properties", excerpt(element.name)));
  const bool vertices = element.name == "vertex";
  if (element.rows > (file_.left() + 1) / stride)
    throw_ply_error(file_.path(),
                    fmt::format("it is truncated: {} {} need {}{} bytes, {} are left", element.rows,
                                vertices ? "vertices" : "rows of " + excerpt(element.name),
                                header_.ascii ? "at least " : "",
                                double(element.rows) * double(stride), file_.left()));
}

void PlyRows::skip(const PlyElementHeader& element) {
  const bool lists = std::any_of(element.properties.begin(), element.properties.end(),
                                 [](const PlyProperty& p) { return p.is_list; });
  if (!header_.ascii && !lists) return skip_fixed(element);
  if (element.properties.empty()) return;
  for (size_t row = 0; row < element.rows; ++row) {
    for (const PlyProperty& property : element.properties) {
      const double n = property.is_list ? next(property.length_type) : 1;
      if (!(n >= 0))
        throw_ply_error(file_.path(), fmt::format("a list of {} has length {}", element.name, n));
      for (double i = 0; i < n; ++i) next(property.type);
    }
    end_row();
  }
}

void PlyRows::skip_fixed(const PlyElementHeader& element) {
  size_t stride = 0;
  for (const PlyProperty& property : element.properties) stride += size_of(property.type);
  if (stride && element.rows > file_.left() / stride) truncated();
  file_.step(element.rows * stride);
}

void PlyRows::truncated() const {
  throw_ply_error(file_.path(), "it is truncated: rows are missing");
}

// `text` begins at the bad word and may go on beyond it.
void PlyRows::refuse_word(std::string_view text, const char* what) const {
  std::string shown;
  for (const char c : text.substr(0, 20)) {
    if (is_blank(c)) break;
    shown += c;
  }
  throw_ply_error(file_.path(), fmt::format("'{}' in line {} {}", shown,
                                            line_of(file_.path(), file_.place()), what));
}

// Advances to the next word; within a row it must be on the same line.
void PlyRows::step_over_blanks() {
  for (;;) {
    const std::string_view text = file_.ahead(longest_word);
    const auto word = std::find_if(text.begin(), text.end(),
                                   [&](char c) { return !is_blank(c) || (c == '\n' && in_row_); });
    file_.step(size_t(word - text.begin()));
    if (word != text.end() && *word == '\n')
      throw_ply_error(file_.path(),
                      fmt::format("line {} has fewer values than its element has properties",
                                  line_of(file_.path(), file_.place())));
    if (word != text.end() || text.empty()) return;
  }
}

double PlyRows::next_word() {
  step_over_blanks();
  const std::string_view text = file_.ahead(longest_word);
  if (text.empty()) truncated();
  in_row_ = true;
  double value = 0;
  const char* const end = text.data() + text.size();
  const bool plus = text[0] == '+' && text.size() > 1 && text[1] != '-';  // from_chars rejects +
  const auto result = std::from_chars(text.data() + plus, end, value);
  const bool whole = result.ptr == end ? text.size() == file_.left() : is_blank(*result.ptr);
  if (result.ec == std::errc::invalid_argument || !whole)  // "0-1" is not two numbers
    refuse_word(text, "is not a number");
  if (result.ec != std::errc()) refuse_word(text, "is outside of the range of doubles");
  file_.step(size_t(result.ptr - text.data()));
  return value;
}

template <class T>
double PlyRows::take() {
  const std::string_view bytes = file_.ahead(sizeof(T));
  if (bytes.size() < sizeof(T)) truncated();
  char ordered[sizeof(T)];
  std::memcpy(ordered, bytes.data(), sizeof(T));
  if (header_.big_endian) std::reverse(ordered, ordered + sizeof(T));
  T value;
  std::memcpy(&value, ordered, sizeof value);
  file_.step(sizeof value);
  return double(value);
}

double PlyRows::next_binary(PlyType type) {
  switch (type) {
    case PlyType::i8:
      return take<int8_t>();
    case PlyType::u8:
      return take<uint8_t>();
    case PlyType::i16:
      return take<int16_t>();
    case PlyType::u16:
      return take<uint16_t>();
    case PlyType::i32:
      return take<int32_t>();
    case PlyType::u32:
      return take<uint32_t>();
    case PlyType::f32:
      return take<float>();
    case PlyType::f64:
      return take<double>();
  }
  truncated();
}

// Ends a row. In ASCII a row must end its line.
void PlyRows::end_row() {
  if (!header_.ascii) return;
  in_row_ = false;
  for (;;) {
    const std::string_view text = file_.ahead(longest_word);
    const auto stop =
        std::find_if(text.begin(), text.end(), [](char c) { return c == '\n' || !is_blank(c); });
    file_.step(size_t(stop - text.begin()));
    if (text.empty() || (stop != text.end() && *stop == '\n')) return;
    if (stop != text.end())
      throw_ply_error(file_.path(),
                      fmt::format("line {} has more values than its element has properties",
                                  line_of(file_.path(), file_.place())));
  }
}

// Data after the last row mean that the header lost a row or a property, so the values read are
// misaligned. Trailing blanks are accepted.
void PlyRows::require_end() {
  for (;;) {
    const std::string_view text = file_.ahead(longest_word);
    const auto more = std::find_if_not(text.begin(), text.end(), is_blank);
    file_.step(size_t(more - text.begin()));
    if (more != text.end())
      throw_ply_error(
          file_.path(),
          fmt::format("{} bytes follow its last row: its header states too few rows or properties",
                      file_.left()));
    if (text.empty()) return;
  }
}

}  // namespace gflow
