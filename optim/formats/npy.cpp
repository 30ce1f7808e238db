// SPDX-License-Identifier: Apache-2.0
// The .npy format: "\x93NUMPY", version, header length, a Python dictionary as text, then the
// values. The file length is checked against the header before values are copied.
#include "optim/formats/npy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr char magic[] = "\x93NUMPY";

// The header's dictionary.
struct NpyHeader {
  std::string descr;
  bool fortran = false;
  std::vector<size_t> shape;
  size_t length = 0;  // offset of the first value [bytes]
};

[[noreturn]] void throw_array_error(const std::string& name, const std::string& why) {
  throw Error(fmt::format("cannot read array {}: {}", name, why));
}

std::string_view without_blanks(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(" \t\n\r\v\f"), text.size()));
}

// Text that follows 'key': in a dictionary; "" if the key is missing.
std::string_view value_of(std::string_view dictionary, std::string_view key) {
  const size_t at = dictionary.find(fmt::format("'{}'", key));
  if (at == dictionary.npos) return "";
  const std::string_view rest = without_blanks(dictionary.substr(at + key.size() + 2));
  return rest.substr(0, 1) == ":" ? without_blanks(rest.substr(1)) : "";
}

// Text between a leading `begin` and the first `end`; "" if there is none.
std::string_view between(char begin, std::string_view text, char end) {
  const size_t stop = text.find(end, 1);
  return text.empty() || text[0] != begin || stop == text.npos ? "" : text.substr(1, stop - 1);
}

// Accepts "3, 4", "3," and "".
std::vector<size_t> parse_shape(std::string_view text, const std::string& name) {
  std::vector<size_t> shape;
  for (size_t at = text.find_first_of("0123456789"); at < text.size();) {
    const size_t end = std::min(text.find_first_not_of("0123456789", at), text.size());
    if (end - at > 15) throw_array_error(name, fmt::format("its shape ({}) is too large", text));
    shape.push_back(std::stoull(std::string(text.substr(at, end - at))));
    at = text.find_first_of("0123456789", end);
  }
  return shape;
}

NpyHeader parse_header(const uint8_t* bytes, size_t length, const std::string& name) {
  if (length < 10 || std::memcmp(bytes, magic, 6) != 0)
    throw_array_error(name, "it is not a .npy file");
  const int version = bytes[6];
  if (version < 1 || version > 3)
    throw_array_error(name, fmt::format("it has format version {}, expected 1 to 3", version));
  const size_t start = version == 1 ? 10 : 12;
  if (length < start) throw_array_error(name, "it is truncated within its header");
  size_t text_length = bytes[8] | size_t(bytes[9]) << 8;
  if (version > 1) text_length |= size_t(bytes[10]) << 16 | size_t(bytes[11]) << 24;
  constexpr size_t longest_header = 65536;  // NumPy writes a few hundred bytes
  if (text_length > longest_header)
    throw_array_error(name, fmt::format("its header is longer than {} bytes", longest_header));
  if (length - start < text_length) throw_array_error(name, "it is truncated within its header");
  const std::string_view text(reinterpret_cast<const char*>(bytes + start), text_length);

  if (text.find("descr") == text.npos) throw_array_error(name, "its header has no 'descr'");
  const std::string_view descr = between('\'', value_of(text, "descr"), '\'');
  if (descr.empty() || descr.size() > 20)
    throw_array_error(name,
                      "it contains records or objects, expected a single number type such as f4");
  const std::string_view order = value_of(text, "fortran_order"), shape = value_of(text, "shape");
  const std::string_view extents = between('(', shape, ')');
  const bool fortran = order.substr(0, 4) == "True";
  if ((!fortran && order.substr(0, 5) != "False") || shape.substr(0, 1) != "(" ||
      shape.find(')') == shape.npos || extents.size() > 200 ||
      extents.find_first_not_of("0123456789, ") != extents.npos)
    throw_array_error(name, "its header has no valid 'fortran_order' and 'shape'");
  return {std::string(descr), fortran, parse_shape(extents, name), start + text_length};
}

// Product of shape. Error if its size in bytes could overflow size_t.
size_t count(const std::vector<size_t>& shape, const std::string& name) {
  size_t n = 1;
  bool empty = false;
  for (size_t extent : shape) {
    empty |= extent == 0;
    if (extent && n > std::numeric_limits<size_t>::max() / 16 / extent)
      throw_array_error(name, fmt::format("its shape ({}) is too large", fmt::join(shape, ", ")));
    n *= extent ? extent : 1;
  }
  return empty ? 0 : n;
}

struct Half {  // IEEE 754 binary16: sign, 5 bits of the exponent, 10 of the fraction
  uint16_t bits;

  explicit operator float() const {
    const int exponent = bits >> 10 & 31, fraction = bits & 1023;
    const float size = exponent == 31  ? (fraction ? NAN : INFINITY)
                       : exponent == 0 ? std::ldexp(float(fraction), -24)
                                       : std::ldexp(float(1024 + fraction), exponent - 25);
    return bits >> 15 ? -size : size;
  }
};

std::vector<float> widened(const std::vector<Half>& halves) {
  return std::vector<float>(halves.begin(), halves.end());
}
template <class T>
std::vector<T> widened(std::vector<T> values) {
  return values;
}

// Values in Fortran order, whose first index runs fastest, in C order.
template <class T>
std::vector<T> in_c_order(const std::vector<T>& values, const std::vector<size_t>& shape) {
  std::vector<T> ordered(values.size());
  std::vector<size_t> index(shape.size());
  for (const T& value : values) {
    size_t place = 0;
    for (size_t axis = 0; axis < shape.size(); ++axis) place = place * shape[axis] + index[axis];
    ordered[place] = value;
    for (size_t axis = 0; axis < shape.size() && ++index[axis] == shape[axis]; ++axis)
      index[axis] = 0;
  }
  return ordered;
}

template <class T>
Array take(const NpyHeader& header, const uint8_t* bytes, size_t length, const std::string& name) {
  const size_t n = count(header.shape, name);
  if (length - header.length != n * sizeof(T))
    throw_array_error(name, fmt::format("it has {} bytes of values, but shape ({}) of {} needs {}",
                                        length - header.length, fmt::join(header.shape, ", "),
                                        header.descr, n * sizeof(T)));
  std::vector<T> values(n);
  if (n) std::memcpy(values.data(), bytes + header.length, n * sizeof(T));
  if (header.fortran && header.shape.size() > 1) values = in_c_order(values, header.shape);
  return {header.shape, widened(std::move(values))};
}

// Calls take(T{}) with the element type T of the header and returns its result.
template <class Take>
auto by_type(const NpyHeader& header, const std::string& name, Take&& take) {
  const std::string& d = header.descr;
  if (d == "<f2") return take(Half{});
  if (d == "<f4") return take(float{});
  if (d == "<f8") return take(double{});
  if (d == "|i1") return take(int8_t{});
  if (d == "|u1" || d == "|b1") return take(uint8_t{});
  if (d == "<i2") return take(int16_t{});
  if (d == "<u2") return take(uint16_t{});
  if (d == "<i4") return take(int32_t{});
  if (d == "<u4") return take(uint32_t{});
  if (d == "<i8") return take(int64_t{});
  throw_array_error(
      name,
      fmt::format(
          "its elements are {}, expected f2 f4 f8 i1 i2 i4 i8 u1 u2 u4 or b1, little-endian", d));
}

template <class T>
constexpr const char* descr_of() {
  if constexpr (std::is_same_v<T, float>) return "<f4";
  if constexpr (std::is_same_v<T, double>) return "<f8";
  if constexpr (std::is_same_v<T, int8_t>) return "|i1";
  if constexpr (std::is_same_v<T, uint8_t>) return "|u1";
  if constexpr (std::is_same_v<T, int16_t>) return "<i2";
  if constexpr (std::is_same_v<T, uint16_t>) return "<u2";
  if constexpr (std::is_same_v<T, int32_t>) return "<i4";
  if constexpr (std::is_same_v<T, uint32_t>) return "<u4";
  if constexpr (std::is_same_v<T, int64_t>) return "<i8";
}

template <class T>
std::vector<T> converted(const Array& array) {
  return std::visit(
      [](const auto& values) {
        std::vector<T> result(values.size());
        for (size_t i = 0; i < values.size(); ++i) result[i] = static_cast<T>(values[i]);
        return result;
      },
      array.values);
}

}  // namespace

size_t Array::size() const {
  return std::visit([](const auto& held) { return held.size(); }, values);
}

std::vector<float> Array::as_float() const { return converted<float>(*this); }
std::vector<double> Array::as_double() const { return converted<double>(*this); }
std::vector<int32_t> Array::as_int() const { return converted<int32_t>(*this); }

std::string Array::shape_text() const {
  return fmt::format("({}{})", fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
}

Array parse_npy(const uint8_t* bytes, size_t length, const std::string& name) {
  const NpyHeader header = parse_header(bytes, length, name);
  return by_type(header, name,
                 [&](auto type) { return take<decltype(type)>(header, bytes, length, name); });
}

size_t npy_length(const uint8_t* bytes, size_t length, const std::string& name) {
  const NpyHeader header = parse_header(bytes, length, name);
  return by_type(header, name, [&](auto type) {
    return header.length + count(header.shape, name) * sizeof(type);
  });
}

Bytes npy_bytes(const Array& array) {
  return std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if (count(array.shape, "to write") != values.size())
          throw Error(fmt::format("cannot write array: shape {} does not match {} values",
                                  array.shape_text(), values.size()));
        std::string text = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}",
                                       descr_of<T>(), array.shape_text());
        // Format 1.0: the header ends with a newline and is padded so that values start at a
        // multiple of 64.
        text.append(63 - (10 + text.size()) % 64, ' ');
        text += '\n';
        Bytes bytes(magic, magic + 6);
        bytes.insert(bytes.end(), {1, 0, uint8_t(text.size() & 255), uint8_t(text.size() >> 8)});
        bytes.insert(bytes.end(), text.begin(), text.end());
        const auto* first = reinterpret_cast<const uint8_t*>(values.data());
        bytes.insert(bytes.end(), first, first + values.size() * sizeof(T));
        return bytes;
      },
      array.values);
}

Array read_npy(const std::string& path) {
  const Bytes bytes = read_file_or_gzip(path, [&](const Bytes& beginning) {
    return npy_length(beginning.data(), beginning.size(), path);
  });
  return parse_npy(bytes.data(), bytes.size(), path);
}

void write_npy(const std::string& path, const Array& array) {
  write_file_atomically(path, npy_bytes(array));
}

}  // namespace gflow
