// SPDX-License-Identifier: Apache-2.0
// Reads and writes whole files. A file written here is either complete or as it was before: bytes
// go to a temporary in the same folder, reach the disk, and only then take the name.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace gflow {

// A file was not written because the disk, or the user's quota, is full: freeing space may help.
struct DiskFull : Error {
  using Error::Error;
};
// Throws "cannot write PATH: why" for the error number `code`; a DiskFull for ENOSPC and EDQUOT.
[[noreturn]] void throw_write_error(const std::string& path, int code);

using Bytes = std::vector<uint8_t>;

// The largest file that is read into memory: 4 GiB. Guards against devices, wrong paths and gzip
// files that expand without end.
inline constexpr size_t largest_file = size_t{1} << 32;

// To be called before a library opens a file: Error if it does not exist or is not a regular file.
// (Opening a pipe would wait for ever.)
void require_file(const std::string& path);

// Contents of a file. Error if it is missing, unreadable or longer than `limit` bytes.
Bytes read_file(const std::string& path, size_t limit = largest_file);

// Length of a file that begins like this (its first MiB, or all of it). Error if the beginning is
// not of that format.
using LengthOf = std::function<size_t(const Bytes& beginning)>;

// As read_file, but expands a gzipped file (recognised by its first two bytes, not its name), up to
// the length that its beginning announces: a few kB expand to GB. Error also if the stream is
// damaged, truncated or longer than that.
Bytes read_file_or_gzip(const std::string& path, const LengthOf& length_of);

// For expanding piece by piece: Error if there is more than the beginning announces. Calls
// length_of once and keeps the answer in `announced`, which must be 0 before.
void require_announced(const Bytes& so_far, const LengthOf& length_of, size_t& announced,
                       const std::string& what);

// Replaces the file at `path` and keeps its permissions. On failure (disk full, no permission) the
// temporary is removed, the old file remains, and the Error names path and reason. Missing folders
// are not made.
void write_file_atomically(const std::string& path, std::string_view bytes);
void write_file_atomically(const std::string& path, const Bytes& bytes);

// The same for bytes that are made while they are written: `write` passes them on piece by piece.
using Append = std::function<void(std::string_view piece)>;
void write_file_in_pieces(const std::string& path, const std::function<void(const Append&)>& write);

// The same for libraries that write files themselves: `write` receives the temporary's name, which
// has the extension of `path`, and throws on failure.
void replace_file(const std::string& path,
                  const std::function<void(const std::string& temporary)>& write);

// Error if `path` is something other than a regular file: a device or pipe must not be replaced.
void require_replaceable(const std::string& path);

// Renames a finished file to `path`, with the permissions of the file that had the name, which may
// be private. Error if it cannot.
void rename_over(const std::string& finished, const std::string& path);

// Makes names in the folder of `path` survive a loss of power, on file systems that can; the files'
// contents do anyway.
void flush_folder_of(const std::string& path);

// Whether a file has the name of a temporary. One that a killed process left behind may be deleted.
bool is_temporary_name(const std::string& filename);

// For libraries that fail without a reason: throws the system's if the temporary of `path` cannot
// grow by 1 MiB (disk full, file size limit). Spoils its contents.
void require_room(const std::string& temporary, const std::string& path);

// To be called before long work that fills a disk: Error if `folder` has less than `bytes` free, or
// nothing if that is not known. what: what needs them, e.g. "optical flow"; instead: what the user
// can do.
void require_free_space(const std::string& folder, uint64_t bytes, const std::string& what,
                        const std::string& instead);

// Gzips bytes without name or time: equal input gives equal output.
Bytes gzip(std::string_view bytes);

}  // namespace gflow
