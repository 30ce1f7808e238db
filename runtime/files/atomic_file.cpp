// SPDX-License-Identifier: Apache-2.0
// POSIX calls, because standard streams neither report errno reliably nor reach the disk on demand.
#include "runtime/files/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <regex>

#include "runtime/base/error.hpp"
#include "runtime/base/unfinished_file.hpp"
#include "runtime/files/descriptor.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {
namespace {

// The n-th temporary of this process beside `path`, in the form that is_temporary_name() knows. The
// extension is kept because libraries choose the format by it.
std::string name_beside(const std::string& path, unsigned n) {
  const std::filesystem::path full(path);
  const std::string stem = full.stem().string(), ending = full.extension().string();
  const std::string own = fmt::format(".{}-{}.part{}", ::getpid(), n, ending);
  // A name may have 255 bytes, so a long stem is cut.
  const size_t room = NAME_MAX - std::min<size_t>(own.size() + 1, NAME_MAX);
  return (full.parent_path() / ("." + stem.substr(0, room) + own)).string();
}

// An empty file beside `path` that no other process or earlier call uses. Removed unless the rename
// made it the real file.
class Temporary {
 public:
  explicit Temporary(const std::string& path) {
    for (unsigned n = 0;; ++n) {
      path_ = name_beside(path, n);
      struct stat info;
      if (::lstat(path_.c_str(), &info) == 0) continue;
      unfinished_.emplace(path_);  // first: a signal may come as soon as it exists
      const Descriptor claim(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
      if (claim.get() >= 0) return;
      if (errno != EEXIST) throw_write_error(path, errno);
    }
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    if (!renamed_) ::unlink(path_.c_str());
  }
  const std::string& path() const { return path_; }
  void rename_to(const std::string& path) {
    rename_over(path_, path);
    renamed_ = true;
    unfinished_.reset();
  }

 private:
  std::string path_;
  std::optional<UnfinishedFile> unfinished_;
  bool renamed_ = false;
};

void flush_to_disk(const std::string& temporary, const std::string& path) {
  const Descriptor file(::open(temporary.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0 || ::fsync(file.get()) != 0) throw_write_error(path, errno);
}

// flag: O_TRUNC for the whole file, O_APPEND for more of it. O_CREAT because some libraries remove
// what they failed to write.
void write_all(const std::string& temporary, int flag, std::string_view bytes,
               const std::string& path) {
  Descriptor file(::open(temporary.c_str(), O_WRONLY | O_CREAT | flag | O_CLOEXEC, 0666));
  bool ok = file.get() >= 0;
  while (ok && !bytes.empty()) {
    const ssize_t written = ::write(file.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    ok = written > 0;
    if (ok) bytes.remove_prefix(size_t(written));
  }
  if (!ok || !file.close()) throw_write_error(path, errno);
}

std::string_view view(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

void throw_write_error(const std::string& path, int code) {
  const std::string sentence = fmt::format("cannot write {}: {}", path, std::strerror(code));
  if (code == ENOSPC || code == EDQUOT) throw DiskFull(sentence);
  throw Error(sentence);
}

void require_file(const std::string& path) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0)
    throw Error(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  if (!S_ISREG(info.st_mode)) throw Error(fmt::format("cannot read {}: it is not a file", path));
}

Bytes read_file(const std::string& path, size_t limit) {
  require_file(path);
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat info;
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0)
    throw Error(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  if (size_t(info.st_size) > limit)
    throw Error(fmt::format("cannot read {}: its {} bytes exceed the limit of {} bytes", path,
                            info.st_size, limit));
  Bytes bytes(size_t(info.st_size));
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::read(file.get(), bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw Error(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
    if (got == 0) break;  // became shorter meanwhile: the reader of the format will notice
    done += size_t(got);
  }
  bytes.resize(done);
  return bytes;
}

void require_announced(const Bytes& so_far, const LengthOf& length_of, size_t& announced,
                       const std::string& what) {
  if (announced == 0) announced = std::min(length_of(so_far), largest_file);
  if (so_far.size() > announced)
    throw Error(
        fmt::format("cannot read {}: data continues after the {} bytes announced by its header",
                    what, announced));
}

Bytes read_file_or_gzip(const std::string& path, const LengthOf& length_of) {
  Bytes stored = read_file(path);
  if (stored.size() < 2 || stored[0] != 0x1f || stored[1] != 0x8b) return stored;

  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK)
    throw Error(fmt::format("cannot decompress {}: zlib failed to initialise", path));
  const std::unique_ptr<z_stream, int (*)(z_stream*)> guard(&stream, inflateEnd);
  const LengthOf plausible_length = [&](const Bytes& beginning) {
    const size_t length = length_of(beginning);
    require_plausible_size(length, stored.size(), path);
    return length;
  };
  Bytes expanded;
  size_t consumed = 0, announced = 0;
  int state = Z_OK;
  // Most files are short: a piece is no longer than they can expand to.
  constexpr size_t most_packed = 1032;  // deflate's limit
  const size_t piece = std::min(size_t{1} << 20, most_packed * stored.size() + 1);
  while (state != Z_STREAM_END) {
    const size_t before = expanded.size();
    expanded.resize(before + piece);
    stream.next_in = stored.data() + consumed;
    stream.avail_in = uInt(std::min(stored.size() - consumed, piece));
    stream.next_out = expanded.data() + before;
    stream.avail_out = uInt(piece);
    const uInt offered = stream.avail_in;
    state = inflate(&stream, Z_NO_FLUSH);
    consumed += offered - stream.avail_in;
    expanded.resize(before + piece - stream.avail_out);
    if (state == Z_BUF_ERROR || (state == Z_OK && offered == 0 && expanded.size() == before))
      throw Error(fmt::format("{} is truncated: its gzip stream has no end", path));
    if (state != Z_OK && state != Z_STREAM_END)
      throw Error(fmt::format("{} is damaged: {}", path, stream.msg ? stream.msg : "not gzip"));
    if (before > 0 || expanded.size() == piece || state == Z_STREAM_END) {  // first piece whole
      require_announced(expanded, plausible_length, announced, path);
      if (state != Z_STREAM_END)
        expanded.reserve(announced + 2 * piece);  // else it would double while it grows
    }
  }
  if (consumed < stored.size())
    throw Error(fmt::format("{} is damaged: {} bytes follow the end of its gzip stream", path,
                            stored.size() - consumed));
  return expanded;
}

void replace_file(const std::string& path,
                  const std::function<void(const std::string& temporary)>& write) {
  require_replaceable(path);
  Temporary temporary(path);
  write(temporary.path());
  flush_to_disk(temporary.path(), path);
  temporary.rename_to(path);
}

void require_replaceable(const std::string& path) {
  if (std::filesystem::exists(path) && !std::filesystem::is_regular_file(path))
    throw Error(fmt::format("cannot write {}: it exists and is not a regular file", path));
}

void rename_over(const std::string& finished, const std::string& path) {
  struct stat former;
  if (::stat(path.c_str(), &former) == 0) ::chmod(finished.c_str(), former.st_mode & 0777);
  if (::rename(finished.c_str(), path.c_str()) != 0) throw_write_error(path, errno);
  flush_folder_of(path);
}

void flush_folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  const Descriptor open(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (open.get() >= 0) ::fsync(open.get());
}

bool is_temporary_name(const std::string& filename) {
  static const std::regex pattern(R"(\..*\.\d+-\d+\.part(\..*)?)");
  return std::regex_match(filename, pattern);
}

void require_room(const std::string& temporary, const std::string& path) {
  write_all(temporary, O_APPEND, std::string(size_t{1} << 20, '\0'), path);
  flush_to_disk(temporary, path);
}

void write_file_atomically(const std::string& path, std::string_view bytes) {
  replace_file(path,
               [&](const std::string& temporary) { write_all(temporary, O_TRUNC, bytes, path); });
}

void write_file_atomically(const std::string& path, const Bytes& bytes) {
  write_file_atomically(path, view(bytes));
}

void write_file_in_pieces(const std::string& path,
                          const std::function<void(const Append&)>& write) {
  constexpr size_t enough = size_t{1} << 20;  // for one system call
  replace_file(path, [&](const std::string& temporary) {
    std::string waiting;
    write([&](std::string_view piece) {
      waiting.append(piece);
      if (waiting.size() < enough) return;
      write_all(temporary, O_APPEND, waiting, path);
      waiting.clear();
    });
    write_all(temporary, O_APPEND, waiting, path);
  });
}

void require_free_space(const std::string& folder, uint64_t bytes, const std::string& what,
                        const std::string& instead) {
  std::error_code failed;
  const std::filesystem::space_info space = std::filesystem::space(folder, failed);
  if (failed || bytes <= space.available) return;
  throw Error(fmt::format("{} would need {:.1f} GB in folder {}, which has only {:.1f} GB free: {}",
                          what, 1e-9 * double(bytes), folder, 1e-9 * double(space.available),
                          instead));
}

Bytes gzip(std::string_view bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, 16 + MAX_WBITS, 8,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error("cannot compress: zlib failed to initialise");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> guard(&stream, deflateEnd);
  Bytes packed(deflateBound(&stream, uLong(bytes.size())));
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = uInt(bytes.size());
  stream.next_out = packed.data();
  stream.avail_out = uInt(packed.size());
  if (bytes.size() >= largest_file || deflate(&stream, Z_FINISH) != Z_STREAM_END)
    throw Error(fmt::format("cannot compress {} bytes at once", bytes.size()));
  packed.resize(packed.size() - stream.avail_out);
  return packed;
}

}  // namespace gflow
