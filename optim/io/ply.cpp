// SPDX-License-Identifier: Apache-2.0
// PLY: a text header naming elements and their properties, then the rows of each element in turn.
// Only element "vertex" is kept; what stands before it is stepped over, what follows is not read.
#include "optim/io/ply.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace {

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };

size_t size_of(Type type) {
  switch (type) {
    case Type::i8:
    case Type::u8:
      return 1;
    case Type::i16:
    case Type::u16:
      return 2;
    case Type::f64:
      return 8;
    default:
      return 4;
  }
}

struct Property {
  std::string name;
  Type type;
  bool is_list = false;
  Type length_type = Type::u8;  // of a list
};

struct Element {
  std::string name;
  size_t rows = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
  std::vector<std::string> comments;
  size_t length = 0;  // bytes up to the first row
};

struct TypedTable {
  PlyTable table;
  std::vector<Type> types;
};

constexpr size_t longest_header = size_t{1} << 20;  // headers have some dozen lines

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(fmt::format("cannot read PLY {}: {}", path, why));
}

Type parse_type(const std::string& word, const std::string& path) {
  static const std::map<std::string, Type> types = {
      {"char", Type::i8},   {"int8", Type::i8},     {"uchar", Type::u8},   {"uint8", Type::u8},
      {"short", Type::i16}, {"int16", Type::i16},   {"ushort", Type::u16}, {"uint16", Type::u16},
      {"int", Type::i32},   {"int32", Type::i32},   {"uint", Type::u32},   {"uint32", Type::u32},
      {"float", Type::f32}, {"float32", Type::f32}, {"double", Type::f64}, {"float64", Type::f64}};
  const auto found = types.find(word);
  if (found == types.end()) refuse(path, fmt::format("'{}' is no property type", word));
  return found->second;
}

Property parse_property(std::istringstream& words, const std::string& path) {
  Property property{};
  std::string type;
  words >> type;
  if (type == "list") {
    property.is_list = true;
    words >> type;
    property.length_type = parse_type(type, path);
    words >> type;
  }
  property.type = parse_type(type, path);
  if (!(words >> property.name)) refuse(path, "a property in its header has no name");
  return property;
}

// One header line; true when it was the last.
bool parse_line(const std::string& line, Header& header, bool& has_format,
                const std::string& path) {
  std::istringstream words(line);
  std::string keyword, word;
  words >> keyword;
  if (keyword == "format") {
    words >> word;
    if (word != "ascii" && word != "binary_little_endian")
      refuse(path,
             fmt::format("its format is '{}', known are ascii and binary_little_endian", word));
    header.ascii = word == "ascii";
    has_format = true;
  } else if (keyword == "element") {
    Element element;
    long long rows = -1;
    words >> element.name >> rows;
    if (!words || rows < 0 || !(words >> std::ws).eof())
      refuse(path, fmt::format("'{}' has no number of rows", line.substr(0, 60)));
    element.rows = size_t(rows);
    header.elements.push_back(element);
  } else if (keyword == "property") {
    if (header.elements.empty()) refuse(path, "a property comes before any element");
    header.elements.back().properties.push_back(parse_property(words, path));
  } else if (keyword == "comment") {
    header.comments.push_back(line.size() > 8 ? line.substr(8) : "");
  } else if (keyword == "end_header") {
    return true;
  } else if (!keyword.empty() && keyword != "obj_info") {
    refuse(path, fmt::format("its header line '{}' is unknown", line.substr(0, 60)));
  }
  return false;
}

Header parse_header(const Bytes& bytes, const std::string& path) {
  if (bytes.size() < 4 || std::memcmp(bytes.data(), "ply", 3) != 0)
    refuse(path, "it does not begin with 'ply'");
  const auto stop = bytes.begin() + long(std::min(bytes.size(), longest_header));
  Header header;
  bool has_format = false, ended = false;
  auto at = std::find(bytes.begin(), stop, '\n');
  while (!ended) {
    const auto end = at == stop ? stop : std::find(at + 1, stop, '\n');
    if (end == stop)
      refuse(path, bytes.size() < longest_header
                       ? "it has no line 'end_header'"
                       : "it has no line 'end_header' within its first MB");
    std::string line(at + 1, end);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    ended = parse_line(line, header, has_format, path);
    at = end;
  }
  if (!has_format) refuse(path, "its header has no line 'format'");
  for (const Element& element : header.elements) {
    std::set<std::string> names;
    for (const Property& property : element.properties)
      if (!names.insert(property.name).second)
        refuse(path, fmt::format("its element '{}' has the property '{}' twice", element.name,
                                 property.name));
  }
  header.length = size_t(at + 1 - bytes.begin());
  return header;
}

// Between words of a text; a 0 is none.
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

// The rows, value by value, in either format. Running past the end is an Error.
class Rows {
 public:
  Rows(const Bytes& bytes, const Header& header, const std::string& path)
      : begin_(reinterpret_cast<const char*>(bytes.data())),
        at_(begin_ + header.length),
        end_(reinterpret_cast<const char*>(bytes.data()) + bytes.size()),
        ascii_(header.ascii),
        path_(path) {}

  size_t bytes_left() const { return size_t(end_ - at_); }

  double next(Type type) { return ascii_ ? next_word() : next_binary(type); }

  // After the last value of a row: in text it ends the line.
  void end_row() {
    if (!ascii_) return;
    while (at_ < end_ && *at_ != '\n' && is_blank(*at_)) ++at_;
    if (at_ < end_ && *at_ != '\n')
      refuse(path_, fmt::format("line {} has more values than its element has properties",
                                1 + std::count(begin_, at_, '\n')));
  }

  void step_over(const Element& element) {
    const bool lists = std::any_of(element.properties.begin(), element.properties.end(),
                                   [](const Property& p) { return p.is_list; });
    if (!ascii_ && !lists) return step_over_fixed(element);
    if (element.properties.empty()) return;
    for (size_t row = 0; row < element.rows; ++row) {
      for (const Property& property : element.properties) {
        const double n = property.is_list ? next(property.length_type) : 1;
        if (!(n >= 0)) refuse(path_, fmt::format("a list of {} is {} long", element.name, n));
        for (double i = 0; i < n; ++i) next(property.type);
      }
      end_row();
    }
  }

 private:
  [[noreturn]] void truncated() const { refuse(path_, "it is truncated: rows are missing"); }

  void step_over_fixed(const Element& element) {
    size_t stride = 0;
    for (const Property& property : element.properties) stride += size_of(property.type);
    if (stride && element.rows > bytes_left() / stride) truncated();
    at_ += element.rows * stride;
  }

  [[noreturn]] void not_a_number(const char* word) const {
    const char* stop = std::find_if(word, std::min(end_, word + 20), is_blank);
    std::string shown;
    for (; word < stop; ++word) shown += *word == '\0' ? "\\0" : std::string(1, *word);
    refuse(path_,
           fmt::format("'{}' in line {} is no number", shown, 1 + std::count(begin_, stop, '\n')));
  }

  double next_word() {
    while (at_ < end_ && is_blank(*at_)) ++at_;
    if (at_ == end_) truncated();
    double value = 0;
    const auto result = std::from_chars(at_, end_, value);
    if (result.ec != std::errc()) not_a_number(at_);
    at_ = result.ptr;
    if (at_ < end_ && !is_blank(*at_)) {  // 0-1 is not two of them
      const char* begin = at_;
      while (begin > begin_ && !is_blank(begin[-1])) --begin;
      not_a_number(begin);
    }
    return value;
  }

  template <class T>
  double take() {
    if (bytes_left() < sizeof(T)) truncated();
    T value;
    std::memcpy(&value, at_, sizeof value);
    at_ += sizeof value;
    return double(value);
  }

  double next_binary(Type type) {
    switch (type) {
      case Type::i8:
        return take<int8_t>();
      case Type::u8:
        return take<uint8_t>();
      case Type::i16:
        return take<int16_t>();
      case Type::u16:
        return take<uint16_t>();
      case Type::i32:
        return take<int32_t>();
      case Type::u32:
        return take<uint32_t>();
      case Type::f32:
        return take<float>();
      case Type::f64:
        return take<double>();
    }
    truncated();
  }

  const char* begin_;
  const char* at_;
  const char* end_;
  bool ascii_;
  const std::string& path_;
};

// Refuses an element that cannot be in the bytes that are left: each ASCII value takes two at least
// (a digit and a space), but for the last.
void check_rows(const Element& element, bool ascii, size_t bytes_left, const std::string& path) {
  size_t stride = 0;
  for (const Property& property : element.properties) {
    if (property.is_list)
      refuse(path, fmt::format("property '{}' of {} is a list, expected are numbers", property.name,
                               element.name));
    stride += ascii ? 2 : size_of(property.type);
  }
  if (!stride) refuse(path, fmt::format("its element '{}' has no properties", element.name));
  const bool vertices = element.name == "vertex";
  if (element.rows > (bytes_left + 1) / stride)
    refuse(path, fmt::format("it is truncated: {} {} need {} bytes, {} follow the header",
                             element.rows, vertices ? "vertices" : "rows of " + element.name,
                             double(element.rows) * double(stride), bytes_left));
}

template <class T>
std::vector<T> read_rows(const Element& element, bool ascii, Rows& rows, const std::string& path) {
  check_rows(element, ascii, rows.bytes_left(), path);
  std::vector<T> values;
  values.reserve(element.rows * element.properties.size());
  for (size_t row = 0; row < element.rows; ++row) {
    for (const Property& property : element.properties)
      values.push_back(T(rows.next(property.type)));
    rows.end_row();
  }
  return values;
}

// Of the values [rows, columns], the middle of x, y and z, in whole units; those that are finite.
std::array<double, 3> origin_of(const std::vector<double>& values, size_t columns,
                                const std::array<int, 3>& position) {
  std::array<double, 3> origin = {0, 0, 0};
  for (size_t axis = 0; axis < 3; ++axis) {
    double sum = 0, count = 0;
    for (size_t i = size_t(position[axis]); i < values.size(); i += columns)
      if (std::isfinite(values[i])) sum += values[i], ++count;
    if (count > 0 && std::isfinite(sum)) origin[axis] = std::round(sum / count);
  }
  return origin;
}

TypedTable read_typed(const std::string& path) {
  const Bytes bytes = read_file(path);
  const Header header = parse_header(bytes, path);
  Rows rows(bytes, header, path);
  for (const Element& element : header.elements) {
    if (element.name != "vertex") {
      rows.step_over(element);
      continue;
    }
    TypedTable result;
    result.table.comments = header.comments;
    result.table.rows = element.rows;
    for (const Property& property : element.properties) {
      result.table.names.push_back(property.name);
      result.types.push_back(property.type);
    }
    const std::array<int, 3> position = {result.table.column("x"), result.table.column("y"),
                                         result.table.column("z")};
    const bool exact = std::all_of(position.begin(), position.end(), [&](int column) {
      return column >= 0 && result.types[size_t(column)] == Type::f64;
    });
    if (!exact) {
      result.table.values = read_rows<float>(element, header.ascii, rows, path);
      return result;
    }
    std::vector<double> values = read_rows<double>(element, header.ascii, rows, path);
    const size_t columns = result.table.names.size();
    result.table.origin = origin_of(values, columns, position);
    for (size_t axis = 0; axis < 3; ++axis)
      for (size_t i = size_t(position[axis]); i < values.size(); i += columns)
        values[i] -= result.table.origin[axis];
    result.table.values.assign(values.begin(), values.end());
    return result;
  }
  refuse(path, "it has no element 'vertex'");
}

template <class T>
void append(std::string& bytes, const T* values, size_t n) {
  bytes.append(reinterpret_cast<const char*>(values), n * sizeof(T));
}

uint8_t to_byte(float value, Type type) {
  const float scaled = type == Type::f32 || type == Type::f64 ? value * 255 : value;
  return uint8_t(std::isfinite(scaled) ? std::clamp(scaled + .5f, 0.f, 255.f) : 0.f);
}

}  // namespace

int PlyTable::column(const std::string& name) const {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : int(found - names.begin());
}

std::vector<float> PlyTable::column_values(const std::string& name) const {
  const int c = column(name);
  if (c < 0) throw Error(fmt::format("the PLY table has no property '{}'", name));
  std::vector<float> result(rows);
  for (size_t row = 0; row < rows; ++row) result[row] = values[row * names.size() + size_t(c)];
  return result;
}

std::vector<std::string> ply_vertex_properties(const std::string& path) {
  require_file(path);
  Bytes beginning(longest_header);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  file.read(reinterpret_cast<char*>(beginning.data()), long(beginning.size()));
  beginning.resize(size_t(file.gcount()));
  std::vector<std::string> names;
  for (const Element& element : parse_header(beginning, path).elements)
    if (element.name == "vertex")
      for (const Property& property : element.properties) names.push_back(property.name);
  return names;
}

PlyTable read_ply(const std::string& path) { return read_typed(path).table; }

int PlyElement::property(const std::string& name) const {
  const auto found = std::find(properties.begin(), properties.end(), name);
  return found == properties.end() ? -1 : int(found - properties.begin());
}

std::vector<PlyElement> read_ply_elements(const std::string& path) {
  const Bytes bytes = read_file(path);
  const Header header = parse_header(bytes, path);
  Rows rows(bytes, header, path);
  std::vector<PlyElement> elements;
  for (const Element& element : header.elements) {
    PlyElement result{element.name, {}, element.rows, {}};
    for (const Property& property : element.properties) result.properties.push_back(property.name);
    result.values = read_rows<double>(element, header.ascii, rows, path);
    elements.push_back(std::move(result));
  }
  return elements;
}

void write_ply(const std::string& path, const PlyTable& table) {
  if (table.names.empty() || table.values.size() != table.rows * table.names.size())
    throw Error(fmt::format("cannot write {}: {} rows of {} properties are not {} values", path,
                            table.rows, table.names.size(), table.values.size()));
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : table.comments) bytes += fmt::format("comment {}\n", comment);
  bytes += fmt::format("element vertex {}\n", table.rows);
  const bool far = table.origin != std::array<double, 3>{0, 0, 0};
  std::vector<int> axes;  // of each column whose values are doubles, else -1
  for (const std::string& name : table.names) {
    const bool position = far && (name == "x" || name == "y" || name == "z");
    axes.push_back(position ? name[0] - 'x' : -1);
    bytes += fmt::format("property {} {}\n", position ? "double" : "float", name);
  }
  bytes += "end_header\n";
  if (!far) append(bytes, table.values.data(), table.values.size());
  for (size_t i = 0; far && i < table.values.size(); ++i) {
    const int axis = axes[i % axes.size()];
    const double place = axis < 0 ? 0 : double(table.values[i]) + table.origin[size_t(axis)];
    if (axis < 0)
      append(bytes, &table.values[i], 1);
    else
      append(bytes, &place, 1);
  }
  write_file_atomically(path, bytes);
}

PointCloud read_point_cloud(const std::string& path) {
  const TypedTable typed = read_typed(path);
  const PlyTable& table = typed.table;
  const int position[3] = {table.column("x"), table.column("y"), table.column("z")};
  const int color[3] = {table.column("red"), table.column("green"), table.column("blue")};
  for (int i = 0; i < 3; ++i)
    if (position[i] < 0) refuse(path, "its vertices have no x, y and z");
  const bool colored = color[0] >= 0 && color[1] >= 0 && color[2] >= 0;
  PointCloud points;
  for (size_t row = 0; row < table.rows; ++row) {
    const float* values = table.values.data() + row * table.names.size();
    for (int i = 0; i < 3; ++i) {
      if (!std::isfinite(values[position[i]]))
        refuse(path, fmt::format("the position of vertex {} is not finite", row));
      points.xyz.push_back(double(values[position[i]]) + table.origin[size_t(i)]);
      if (colored) points.rgb.push_back(to_byte(values[color[i]], typed.types[size_t(color[i])]));
    }
  }
  return points;
}

void write_point_cloud(const std::string& path, const PointCloud& points) {
  const bool colored = !points.rgb.empty();
  if (points.xyz.size() % 3 || (colored && points.rgb.size() != points.xyz.size()))
    throw Error(fmt::format("cannot write {}: {} coordinates do not fit {} colour values", path,
                            points.xyz.size(), points.rgb.size()));
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n{}end_header\n",
      points.size(),
      colored ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "");
  for (size_t i = 0; i < points.size(); ++i) {
    const float place[3] = {float(points.xyz[3 * i]), float(points.xyz[3 * i + 1]),
                            float(points.xyz[3 * i + 2])};
    append(bytes, place, 3);
    if (colored) append(bytes, points.rgb.data() + 3 * i, 3);
  }
  write_file_atomically(path, bytes);
}

}  // namespace gflow
