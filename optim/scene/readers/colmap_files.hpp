// SPDX-License-Identifier: Apache-2.0
// Values of COLMAP's files in order: binary files, whose records have variable length, and text
// files. Errors name the place.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/files/file_pieces.hpp"

namespace gflow {

// Little-endian values of a binary file in order. Error if the file ends too early.
class ColmapBinary {
 public:
  explicit ColmapBinary(const std::string& path) : file_(path) {}

  template <class T>
  T next() {
    T value;
    const std::string_view bytes = file_.ahead(sizeof value);
    if (bytes.size() < sizeof value) truncated();
    std::memcpy(&value, bytes.data(), sizeof value);
    file_.step(sizeof value);
    return value;
  }
  // A zero-terminated name.
  std::string next_name() {
    std::string name;
    while (const char c = next<char>()) {
      name += c;
      if (name.size() > 4096)
        throw Error(
            fmt::format("{} is damaged: it has an image name without an end", file_.path()));
    }
    return name;
  }
  // A count of records of at least `record` bytes. Error if the rest of the file is too short.
  uint64_t next_count(size_t record) {
    const auto n = next<uint64_t>();
    need(n, record);
    return n;
  }
  // Skips n records of `record` bytes.
  void skip(uint64_t n, size_t record) {
    need(n, record);
    file_.step(n * record);
  }
  // Error if bytes are left.
  void require_end() const {
    if (file_.left() > 0)
      throw Error(fmt::format("{} is damaged: {} bytes follow its last record", file_.path(),
                              file_.left()));
  }

 private:
  void need(uint64_t n, size_t record) const {
    if (n > file_.left() / record) truncated();
  }
  [[noreturn]] void truncated() const {
    throw Error(fmt::format("{} is truncated: it ends within its records", file_.path()));
  }

  FilePieces file_;
};

// The non-comment lines of a text file, and the words of the current line.
class ColmapText {
 public:
  // `entry` describes a line, for messages.
  ColmapText(const std::string& path, const char* entry) : file_(path), entry_(entry) {}

  // Reads the next line, which may be blank; false at the end of the file.
  bool next_line() {
    constexpr const char* byte_order = "\xef\xbb\xbf";  // byte order mark, added by some editors
    if (file_.place() == 0 && file_.ahead(3) == byte_order) file_.step(3);
    do {
      for (; file_.ahead(1) == "#"; ++number_) file_.skip_line();
      ++number_;
      at_ = 0;
      if (!file_.next_line(line_)) return false;
    } while (!is_blank() && line_[line_.find_first_not_of(blanks)] == '#');
    return true;
  }
  // Reads the next line that is not blank; false at the end of the file.
  bool next_entry() {
    while (next_line())
      if (!is_blank()) return true;
    return false;
  }
  bool is_blank() const { return line_.find_first_not_of(blanks) == std::string::npos; }
  // Goes back to the beginning of the current line.
  void restart_line() { at_ = 0; }
  // False if the line was cut at longest_line.
  bool is_whole() const { return line_.size() < FilePieces::longest_line; }

  // The next word of the line; empty at its end.
  std::string_view word() {
    at_ = std::min(line_.find_first_not_of(blanks, at_), line_.size());
    const size_t end = std::min(line_.find_first_of(blanks, at_), line_.size());
    const std::string_view word = std::string_view(line_).substr(at_, end - at_);
    at_ = end;
    return word;
  }
  // The rest of the line after the words read so far, without blanks around it.
  std::string rest() const {
    const size_t begin = std::min(line_.find_first_not_of(blanks, at_), line_.size());
    return line_.substr(begin, line_.find_last_not_of(blanks) + 1 - begin);
  }
  // The next word as a number. Error if it is missing or not a number; `what` names it.
  template <class Number>
  Number number(const char* what) {
    const std::string_view text = word();
    if (text.empty()) refuse(fmt::format("ends before {}", what));
    Number value = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
    const size_t exponent = text.find_first_of("eE") + 1;  // 0 without an exponent
    const bool tiny = std::is_floating_point_v<Number> && exponent > 0 &&
                      text.substr(exponent, 1) == "-";  // underflow is read as 0
    const bool fits = read.ec == std::errc() || (read.ec == std::errc::result_out_of_range && tiny);
    if (!fits || read.ptr != text.data() + text.size() || !std::isfinite(double(value)))
      refuse(fmt::format("has '{}' as {}, which must be {}", excerpt(std::string(text)), what,
                         std::is_floating_point_v<Number> ? "a finite number" : "an integer"));
    return value;
  }
  // Throws "line 7 of cameras.txt WHY; expected ENTRY".
  [[noreturn]] void refuse(const std::string& why) const {
    throw Error(fmt::format("line {} of {} {}; expected {}", number_, file_.path(), why, entry_));
  }

 private:
  static constexpr const char* blanks = " \t\r";

  FilePieces file_;
  const char* entry_;
  std::string line_;
  size_t number_ = 0, at_ = 0;
};

}  // namespace gflow
