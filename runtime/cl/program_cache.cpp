// SPDX-License-Identifier: Apache-2.0
// File: magic, length, checksum of key and bytes, the driver's bytes. Written under another name
// and renamed, so that a reader never sees half a file.
// Off for PoCL, which has a cache of its own: asked for a binary, PoCL (3.1) compiles every kernel
// once more, for groups of any size, which doubles the time of a first start.
#include "runtime/cl/program_cache.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "runtime/base/hash.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
const char magic[8] = {'G', 'F', 'L', 'O', 'W', 'B', 'I', '2'};

constexpr uintmax_t largest_binary = uintmax_t{1} << 30;  // today's have a few MB

struct Header {
  char magic[8];
  uint64_t length, checksum;
};

std::string cache_folder(const DeviceInfo& device) {
  if (const char* folder = std::getenv("GFLOW_CACHE_DIR")) return folder;
  if (is_pocl(device)) return "";
  if (const char* folder = std::getenv("XDG_CACHE_HOME"); folder && *folder)
    return std::string(folder) + "/gflow";
  if (const char* home = std::getenv("HOME"); home && *home)
    return std::string(home) + "/.cache/gflow";
  return "";
}

// "" if it cannot be read.
std::string contents(const std::string& path) {
  std::error_code failed;
  const uintmax_t size = fs::file_size(path, failed);  // read at once, to be in memory only once
  if (failed || size > largest_binary) return "";
  std::string bytes(size_t(size), '\0');
  std::ifstream in(path, std::ios::binary);
  in.read(bytes.data(), std::streamsize(size));
  return in ? bytes : "";
}

}  // namespace

std::string_view verified_binary(std::string_view file, uint64_t key) {
  Header header;
  if (file.size() < sizeof header) return {};
  std::memcpy(&header, file.data(), sizeof header);
  const std::string_view bytes = file.substr(sizeof header);
  const bool whole = std::memcmp(header.magic, magic, sizeof magic) == 0 &&
                     header.length == bytes.size() &&
                     header.checksum == hash(bytes.data(), bytes.size(), key);
  return whole ? bytes : std::string_view{};
}

ProgramCache::ProgramCache(const Queue& queue, const std::string& source,
                           const std::string& options) {
  const std::string folder = cache_folder(queue.info);
  if (folder.empty()) return;
  const auto& info = queue.info;
  const std::string key = info.platform + "\n" + info.name + "\n" + info.version + "\n" +
                          info.driver + "\n" + options + "\n" + source;
  key_ = hash(key);
  path_ = fmt::format("{}/{:016x}{:016x}.bin", folder, key_, hash(key, 0x9e3779b97f4a7c15u));
}

cl::Program ProgramCache::load(Queue& queue, const std::string& options) const {
  if (path_.empty()) return {};
  const std::string file = contents(path_);
  const std::string_view bytes = verified_binary(file, key_);
  if (bytes.empty()) return {};
  try {
    cl::Program program(queue.context, {queue.device},
                        {std::vector<unsigned char>(bytes.begin(), bytes.end())});
    program.build(queue.device, options.c_str());
    return program;
  } catch (const cl::Error&) {
    return {};  // the driver no longer accepts its own binary
  }
}

void ProgramCache::store(const cl::Program& program) const {
  if (path_.empty()) return;
  try {
    const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
    if (binaries.size() != 1 || binaries[0].empty()) return;
    const auto* bytes = reinterpret_cast<const char*>(binaries[0].data());
    const size_t length = binaries[0].size();
    Header header;
    std::memcpy(header.magic, magic, sizeof magic);
    header.length = length;
    header.checksum = hash(bytes, length, key_);

    fs::create_directories(fs::path(path_).parent_path());
    const std::string draft = fmt::format("{}.{}.tmp", path_, ::getpid());
    std::ofstream out(draft, std::ios::binary);
    out.write(reinterpret_cast<const char*>(&header), sizeof header);
    out.write(bytes, std::streamsize(length));
    out.close();
    std::error_code failed;
    if (out) fs::rename(draft, path_, failed);
    if (!out || failed) fs::remove(draft, failed);
  } catch (const cl::Error&) {  // a driver without binaries
  } catch (const fs::filesystem_error&) {
  }
}

}  // namespace gflow
