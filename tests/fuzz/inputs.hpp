// SPDX-License-Identifier: Apache-2.0
// Turns fuzzer inputs into files, and files into seeds.
#pragma once
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "tests/fuzz/checksums.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/support/scene_files.hpp"

namespace gflow::fuzz {

namespace fs = std::filesystem;

// A folder in memory for the lifetime of the process.
inline const std::string& folder() {
  static const struct Folder {
    std::string path = fmt::format("/dev/shm/gflow-fuzz-{}", ::getpid());
    Folder() { fs::create_directories(path); }
    ~Folder() { fs::remove_all(path); }
  } folder;
  return folder.path;
}

inline void write(const std::string& name, const void* bytes, size_t size) {
  const fs::path path = folder() + "/" + name;
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(static_cast<const char*>(bytes), long(size));
}
inline void write(const std::string& name, const std::string& text) {
  write(name, text.data(), text.size());
}

template <class Read>
void may_refuse(Read&& read) {
  try {
    read();
  } catch (const Error&) {
  } catch (const fs::filesystem_error& problem) {  // the program reports path and reason
    if (problem.code() != std::errc::filename_too_long) throw;
  }
}

// Calls `read` with the bytes as a file of that name.
template <class Read>
void as_file(const uint8_t* bytes, size_t size, const std::string& name, Read&& read) {
  write(name, bytes, size);
  may_refuse([&] { read(folder() + "/" + name); });
}
template <class Read>
void as_zip(const uint8_t* bytes, size_t size, const std::string& name, Read&& read) {
  write(name, with_checksums(bytes, size));
  may_refuse([&] { read(folder() + "/" + name); });
}

template <class Read>
void as_png(const uint8_t* bytes, size_t size, const std::string& name, Read&& read) {
  write(name, with_png_checksums(bytes, size));
  may_refuse([&] { read(folder() + "/" + name); });
}

struct File {
  std::string name, text;
};

using Files = std::vector<File>;

// The index of the file that the first byte selects, and how much it can hold: its size if it is
// text or plain numbers.
inline size_t chosen_file(const Files& files, const uint8_t* bytes) {
  return bytes[0] % files.size();
}
inline Holds held_by(const Files& files, const uint8_t* bytes, size_t size) {
  if (size == 0) return Holds::its_size;
  const fs::path ending = fs::path(files[chosen_file(files, bytes)].name).extension();
  for (const char* plain : {".json", ".jsonl", ".toml", ".npy", ".bin", ".txt", ".flo", ".ply"})
    if (ending == plain) return Holds::its_size;
  return Holds::packed;
}
template <const Files& (*files)()>
Holds held(const uint8_t* bytes, size_t size) {
  return held_by(files(), bytes, size);
}

// A scene of these files; the remaining bytes replace the selected one.
template <class Read>
void in_scene(const uint8_t* bytes, size_t size, const std::string& scene, const Files& files,
              Read&& read) {
  if (size == 0) return;
  const size_t other = chosen_file(files, bytes);
  for (size_t i = 0; i < files.size(); ++i)
    if (i != other)
      write(scene + "/" + files[i].name, files[i].text);
    else if (fs::path(files[i].name).extension() == ".npz")
      write(scene + "/" + files[i].name, with_checksums(bytes + 1, size - 1));
    else
      write(scene + "/" + files[i].name, bytes + 1, size - 1);
  may_refuse([&] { read(folder() + "/" + scene); });
}

inline void seed(const std::string& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder + "/" + name, std::ios::binary) << bytes;
}
inline void seeds_of(const std::string& folder, const Files& files) {
  for (size_t i = 0; i < files.size(); ++i)
    seed(folder, std::to_string(i), std::string(1, char(i)) + files[i].text);
}
inline void copy_seed(const std::string& folder, const std::string& path) {
  seed(folder, fs::path(path).filename().string(), contents(path));
}
// The beginning of a file of the shared data, if it exists, up to the size of inputs. `before`
// precedes it, such as the byte that selects it among several.
inline void real_seed(const std::string& folder, const std::string& name,
                      const std::string& before = "",
                      const std::function<std::string(const std::string&)>& read = contents) {
  if (!fs::exists(shared("data"))) return;
  constexpr size_t most = 65536;
  const std::string text = read(shared("data/" + name));
  if (text.empty()) throw std::logic_error("no seed in " + shared("data/" + name));
  seed(folder, "real_" + fs::path(name).filename().string(), (before + text).substr(0, most));
}

inline std::string capture(const std::string& name) {
  return contents(std::string(GFLOW_SOURCE_DIR) + "/tests/data/captures/" + name);
}

// An image of this size as the bytes of a PNG.
inline std::string png(int width, int height, int channels = 3) {
  const std::string name = folder() + "/made.png";
  write_png(name, pattern(width, height, channels));
  return contents(name);
}

inline std::string written(const std::string& name,
                           const std::function<void(const std::string&)>& write) {
  write(folder() + "/" + name);
  return contents(folder() + "/" + name);
}

}  // namespace gflow::fuzz
