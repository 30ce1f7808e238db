// SPDX-License-Identifier: Apache-2.0
// Whole files in and out. A file written here is either complete or as it was before: bytes go to
// a temporary in the same folder, reach the disk, and only then take the name.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace gflow {

// A file that was not written because the disk, or the user's share of it, is full: what makes room
// may help.
struct DiskFull : Error {
  using Error::Error;
};
// The error of the system's number `code`: "cannot write PATH: why".
[[noreturn]] void refuse_to_write(const std::string& path, int code);

using Bytes = std::vector<uint8_t>;

// The largest file that is read into memory: 4 GiB. Guards against devices, wrong paths and gzip
// files that expand without end.
inline constexpr size_t largest_file = size_t{1} << 32;

// Before a library opens it: Error when there is no file of that name, or something else, as a
// folder or a pipe, which would be waited for without end.
void require_file(const std::string& path);

// Contents of a file. Error when it is missing, unreadable or longer than `limit` bytes.
Bytes read_file(const std::string& path, size_t limit = largest_file);

// How long a file is that begins like this (its first MiB, or all of it); Error when it says
// nothing of the kind.
using LengthOf = std::function<size_t(const Bytes& beginning)>;

// As read_file; a gzipped file (by its first two bytes, not its name) is expanded, but no further
// than `length_of` its beginning: a few kB expand to GB. Error also when the stream is damaged,
// ends early or goes on after that.
Bytes read_file_or_gzip(const std::string& path, const LengthOf& length_of);

// For what is expanded piece by piece: Error when there is more than the beginning announces. Asks
// length_of once; `announced` keeps the answer, 0 before.
void require_announced(const Bytes& so_far, const LengthOf& length_of, size_t& announced,
                       const std::string& what);

// Replaces the file at path, whose permissions stay. On failure (disk full, no permission) the
// temporary is removed, the old file remains, and the Error says path and reason. Missing folders
// are not made.
void write_file_atomically(const std::string& path, std::string_view bytes);
void write_file_atomically(const std::string& path, const Bytes& bytes);

// The same of bytes that are made while they are written: `write` hands them over a piece at a
// time.
using Append = std::function<void(std::string_view piece)>;
void write_file_in_pieces(const std::string& path, const std::function<void(const Append&)>& write);

// The same for libraries that write files themselves: `write` receives the temporary's name, which
// has the extension of path, and throws when it fails.
void replace_file(const std::string& path,
                  const std::function<void(const std::string& temporary)>& write);

// Error where something that is no file has the name: a device or pipe must not be replaced.
void require_replaceable(const std::string& path);

// Gives a finished file the name `path`, and the permissions of the file that had it, which may be
// private. Error when it cannot.
void take_place(const std::string& finished, const std::string& path);

// So that names in the folder of `path`, too, outlast a loss of power. Not every file system can;
// the files themselves are safe.
void flush_folder_of(const std::string& path);

// Whether a file has the name of a temporary: one that a killed process left behind is worth
// nothing.
bool is_temporary_name(const std::string& filename);

// For libraries that fail without a reason: Error with the system's if the temporary of path cannot
// grow by 1 MiB (disk full, file size limit). What it holds is spoiled.
void require_room(const std::string& temporary, const std::string& path);

// Before long work whose results fill a disk: Error when `folder` has not `bytes` free for them.
// what: they are, e.g. "optical flow"; instead: what the user can do. Where the system does not
// tell there is no Error.
void require_free_space(const std::string& folder, uint64_t bytes, const std::string& what,
                        const std::string& instead);

// Bytes gzipped, without name or time: equal input gives equal output.
Bytes gzip(std::string_view bytes);

}  // namespace gflow
