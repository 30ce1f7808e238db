// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "runtime/files/descriptor.hpp"

namespace gflow {

// A file from beginning to end, a piece at a time, so that it is never in memory as a whole.
class FilePieces {
 public:
  static constexpr size_t longest_line = size_t{1} << 20;

  // Errors as those of read_file (atomic_file.hpp): missing, unreadable, not a file, or too long.
  explicit FilePieces(const std::string& path);

  const std::string& path() const { return path_; }
  // Bytes before this position, and from here to the end. [bytes]
  size_t place() const { return place_; }
  size_t left() const { return size_ - place_; }

  // The next `most` bytes, or all that are left if there are fewer, without advancing. Valid until
  // the next call or line. Error if they cannot be read.
  std::string_view ahead(size_t most) {
    if (held_ < most && held_ < left()) hold(most);
    return {piece_.data() + first_, held_ < most ? held_ : most};
  }
  // Advances by n bytes; n is at most left().
  void step(size_t n);

  // Advance over the rest of a line. The first stores it in `line`, without its end and cut at
  // longest_line. False at the end of the file.
  bool next_line(std::string& line);
  bool skip_line();

 private:
  void hold(size_t most);
  bool pass_line(std::string* line);

  std::string path_;
  Descriptor file_;
  size_t size_ = 0, place_ = 0;
  std::vector<char> piece_;
  size_t first_ = 0, held_ = 0;  // the part of the piece that is still ahead
};

// The line, from 1, that a byte of a file is in, for messages; 0 if the file cannot be read again.
size_t line_of(const std::string& path, size_t place);

}  // namespace gflow
