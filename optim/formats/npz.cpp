// SPDX-License-Identifier: Apache-2.0
// NumPy archives through libzip.
#include "optim/formats/npz.hpp"

#include <fmt/format.h>
#include <zip.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <vector>

#include "optim/formats/zip_output.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

constexpr char suffix[] = ".npy";
constexpr size_t suffix_length = 4;

struct ErrorText {
  explicit ErrorText(int code) { zip_error_init_with_code(&error, code); }
  ErrorText(const ErrorText&) = delete;
  ErrorText& operator=(const ErrorText&) = delete;
  ~ErrorText() { zip_error_fini(&error); }
  const char* text() { return zip_error_strerror(&error); }
  zip_error_t error;
};

struct Discard {
  void operator()(zip_t* archive) const { zip_discard(archive); }
  void operator()(zip_file_t* entry) const { zip_fclose(entry); }
};
using Archive = std::unique_ptr<zip_t, Discard>;
using Entry = std::unique_ptr<zip_file_t, Discard>;

bool begins_as_archive(const std::string& path) {
  char begin[4] = {};
  std::ifstream(path, std::ios::binary).read(begin, sizeof begin);
  return std::memcmp(begin, "PK\3\4", sizeof begin) == 0;
}

// Whether the archive has no directory, which is its last part.
bool lacks_directory(int code) {
#ifdef ZIP_ER_TRUNCATED_ZIP  // libzip 1.11 and later, for files that begin as an archive
  if (code == ZIP_ER_TRUNCATED_ZIP) return true;
#endif
  return code == ZIP_ER_NOZIP;
}

Archive open_archive(const std::string& path) {
  int code = 0;
  Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code));
  if (archive) return archive;
  std::string why = ErrorText(code).text();
  // libzip reports these two cases as "Operation not supported" and "Not a zip archive".
  std::error_code unknown;
  if (std::filesystem::is_directory(path, unknown))
    why = "it is a folder, expected an .npz file";
  else if (std::filesystem::is_other(path, unknown))  // such as a pipe
    why = "it is not a file";
  else if (lacks_directory(code))
    why = begins_as_archive(path)
              ? "it is truncated or damaged: the zip directory at its end is missing"
              : "it is not an .npz file (a zip archive of arrays)";
  else if (begins_as_archive(path))
    why = fmt::format("it is damaged or unreadable ({})", why);
  throw Error(fmt::format("cannot read {}: {}", path, why));
}

// Name of entry i without ".npy". Error if the entry is not an array.
std::string name_of_array(zip_t* archive, zip_uint64_t i, const std::string& path) {
  const char* stored = zip_get_name(archive, i, 0);
  std::string name = stored ? stored : "";
  if (name.size() <= suffix_length ||
      name.compare(name.size() - suffix_length, suffix_length, suffix) != 0)
    throw Error(fmt::format("cannot read {}: its entry '{}' is not a .npy array", path, name));
  name.resize(name.size() - suffix_length);
  return name;
}

// Bytes of entry i, at most what its header announces and `plausible` accepts. Read in pieces,
// because the size stated by a damaged archive can be anything.
Bytes entry_bytes(zip_t* archive, zip_uint64_t i, const std::string& name,
                  const std::function<void(size_t length)>& plausible) {
  const Entry entry(zip_fopen_index(archive, i, 0));
  if (!entry)
    throw Error(fmt::format("cannot read array {}: {}; the file may be damaged", name,
                            zip_strerror(archive)));
  Bytes bytes;
  size_t announced = 0;
  const auto length_of = [&](const Bytes& beginning) {
    const size_t length = npy_length(beginning.data(), beginning.size(), name);
    plausible(length);
    return length;
  };
  for (;;) {
    constexpr size_t piece = size_t{1} << 20;
    const size_t before = bytes.size();
    bytes.resize(before + piece);
    const zip_int64_t got = zip_fread(entry.get(), bytes.data() + before, piece);
    if (got < 0)
      throw Error(fmt::format("cannot read array {}: {}", name, zip_file_strerror(entry.get())));
    bytes.resize(before + size_t(got));
    if (got == 0) return bytes;
    if (bytes.size() < piece) continue;  // a small array; the next read returns its end
    require_announced(bytes, length_of, announced, "array " + name);
    bytes.reserve(announced + 2 * piece);  // growing would double the capacity
  }
}

}  // namespace

Arrays read_npz(const std::string& path, const std::set<std::string>& only, size_t always) {
  std::error_code gone;  // a missing file is reported by open_archive
  const size_t file_size = std::filesystem::file_size(path, gone);
  const Archive archive = open_archive(path);
  size_t unpacked = 0;  // bytes of all arrays
  Arrays arrays;
  const zip_int64_t n = zip_get_num_entries(archive.get(), 0);
  for (zip_uint64_t i = 0; i < zip_uint64_t(n); ++i) {
    const std::string name = name_of_array(archive.get(), i, path);
    if (!only.empty() && !only.count(name)) continue;
    const std::string where = fmt::format("'{}' of {}", name, path);
    const Bytes bytes = entry_bytes(archive.get(), i, where, [&](size_t more) {
      require_plausible_size(unpacked + more, file_size, path, always);
    });
    unpacked += bytes.size();
    require_plausible_size(unpacked, file_size, path, always);
    if (!arrays.emplace(name, parse_npy(bytes.data(), bytes.size(), where)).second)
      throw Error(fmt::format("cannot read {}: it has the array '{}' twice", path, name));
  }
  return arrays;
}

std::vector<std::string> names_in_npz(const std::string& path) {
  const Archive archive = open_archive(path);
  std::vector<std::string> names;
  const zip_int64_t n = zip_get_num_entries(archive.get(), 0);
  for (zip_uint64_t i = 0; i < zip_uint64_t(n); ++i)
    names.push_back(name_of_array(archive.get(), i, path));
  return names;
}

void write_npz(const std::string& path, const Arrays& arrays, Packing packing) {
  if (arrays.empty()) throw Error(fmt::format("cannot write {}: there are no arrays", path));
  // libzip reads its sources when it closes the archive: they must live until then.
  std::vector<Bytes> contents;
  contents.reserve(arrays.size());
  replace_file(path, [&](const std::string& temporary) {
    ZipOutput output(temporary);
    Archive archive(output.open());
    for (const auto& [name, array] : arrays) {
      contents.push_back(npy_bytes(array));
      zip_source_t* source =
          zip_source_buffer(archive.get(), contents.back().data(), contents.back().size(), 0);
      const zip_int64_t index =
          source ? zip_file_add(archive.get(), (name + suffix).c_str(), source, ZIP_FL_ENC_UTF_8)
                 : -1;
      if (index < 0) {
        if (source) zip_source_free(source);
        throw Error(
            fmt::format("cannot write '{}' to {}: {}", name, path, zip_strerror(archive.get())));
      }
      // A fixed time stamp (1980-01-01, the earliest of the format), so that equal arrays give
      // equal files.
      zip_file_set_dostime(archive.get(), zip_uint64_t(index), 0, 1 << 5 | 1, 0);
      if (packing == Packing::stored)
        zip_set_file_compression(archive.get(), zip_uint64_t(index), ZIP_CM_STORE, 0);
    }
    if (zip_close(archive.get()) != 0) {
      zip_error_t* why = zip_get_error(archive.get());
      const bool of_system = zip_error_system_type(why) == ZIP_ET_SYS;
      if (of_system && zip_error_code_system(why) != 0)
        throw_write_error(path, zip_error_code_system(why));
      throw Error(fmt::format("cannot write {}: {}", path, zip_strerror(archive.get())));
    }
    archive.release();  // already closed; zip_discard would free it again
  });
}

const Array& array_named(const Arrays& arrays, std::string_view name, const std::string& path) {
  const auto found = arrays.find(std::string(name));
  if (found != arrays.end()) return found->second;
  constexpr size_t most_named = 8;
  std::string names;
  for (const auto& entry : arrays) names += (names.empty() ? "" : ", ") + entry.first;
  if (arrays.size() > most_named) names = fmt::format("{} others", arrays.size());
  throw Error(
      fmt::format("{} has no array '{}'{}", path, name, names.empty() ? "" : "; it has " + names));
}

}  // namespace gflow
