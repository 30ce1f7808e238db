// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/file_pieces.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

constexpr size_t piece_size = size_t{1} << 18;

}  // namespace

FilePieces::FilePieces(const std::string& path)
    : path_((require_file(path), path)), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat info;
  if (file_.get() < 0 || ::fstat(file_.get(), &info) != 0)
    throw Error(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  size_ = size_t(info.st_size);
  if (size_ > largest_file)
    throw Error(fmt::format("cannot read {}: its {} bytes exceed the limit of {} bytes", path,
                            size_, largest_file));
}

void FilePieces::hold(size_t most) {
  most = std::min(most, left());
  if (piece_.size() < std::max(most, piece_size))
    piece_.resize(std::min(std::max(most, piece_size), first_ + left()));
  std::memmove(piece_.data(), piece_.data() + first_, held_);
  first_ = 0;
  const size_t room = std::min(piece_.size(), left());
  while (held_ < room) {
    const ssize_t got = ::read(file_.get(), piece_.data() + held_, room - held_);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw Error(fmt::format("cannot read {}: {}", path_, std::strerror(errno)));
    if (got == 0) size_ = place_ + held_;  // it became shorter meanwhile
    if (got == 0) break;
    held_ += size_t(got);
  }
}

void FilePieces::step(size_t n) {
  if (n > held_) {
    if (::lseek(file_.get(), off_t(n - held_), SEEK_CUR) < 0)
      throw Error(fmt::format("cannot read {}: {}", path_, std::strerror(errno)));
    first_ = held_ = 0;
  } else {
    first_ += n;
    held_ -= n;
  }
  place_ += n;
}

bool FilePieces::pass_line(std::string* line) {
  if (left() == 0) return false;
  for (bool ended = false; !ended && left() > 0;) {
    ahead(1);
    const std::string_view text(piece_.data() + first_, held_);
    const size_t length = std::min(text.find('\n'), text.size());
    ended = length < text.size();
    if (line) line->append(text.substr(0, std::min(length, longest_line - line->size())));
    step(length + size_t(ended));
  }
  if (line && !line->empty() && line->back() == '\r') line->pop_back();
  return true;
}

bool FilePieces::next_line(std::string& line) {
  line.clear();
  return pass_line(&line);
}

bool FilePieces::skip_line() { return pass_line(nullptr); }

size_t line_of(const std::string& path, size_t place) {
  try {
    FilePieces file(path);
    size_t line = 1;
    while (file.place() < place && file.left() > 0) {
      const std::string_view text = file.ahead(std::min(piece_size, place - file.place()));
      line += size_t(std::count(text.begin(), text.end(), '\n'));
      file.step(text.size());
    }
    return line;
  } catch (const Error&) {
    return 0;
  }
}

}  // namespace gflow
