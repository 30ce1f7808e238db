// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "runtime/files/descriptor.hpp"

namespace gflow {

// A file from its beginning to its end, a piece at a time: reading takes no more memory than what
// is made of it.
class FilePieces {
 public:
  static constexpr size_t longest_line = size_t{1} << 20;

  // Errors as read_file's (atomic_file.hpp): missing, unreadable, no file, or too long.
  explicit FilePieces(const std::string& path);

  const std::string& path() const { return path_; }
  // Bytes behind this place, and from here to the end. [bytes]
  size_t place() const { return place_; }
  size_t left() const { return size_ - place_; }

  // The next `most` bytes without stepping over them, or all that are left where those are fewer.
  // They stay where they are until this is called again. Error when they cannot be read.
  std::string_view ahead(size_t most) {
    if (held_ < most && held_ < left()) hold(most);
    return {piece_.data() + first_, held_ < most ? held_ : most};
  }
  // Over n bytes; n is at most left().
  void step(size_t n);

  // Steps over the rest of a line; the first puts it into `line`, without the characters that end
  // it, of a longer one than longest_line what is no longer. False at the end of the file.
  bool next_line(std::string& line);
  bool skip_line();

 private:
  void hold(size_t most);
  bool pass_line(std::string* line);

  std::string path_;
  Descriptor file_;
  size_t size_ = 0, place_ = 0;
  std::vector<char> piece_;
  size_t first_ = 0, held_ = 0;  // what of the piece is still ahead
};

// The number of the line that a byte of a file is in, from 1: what errors tell. 0 where the file
// cannot be read anew.
size_t line_of(const std::string& path, size_t place);

}  // namespace gflow
