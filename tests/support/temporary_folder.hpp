// SPDX-License-Identifier: Apache-2.0
// Temporary folders and file contents for tests, and checks of error messages.
#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/files/temporary_folder.hpp"

// A temporary folder, removed with the object.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_(gflow::make_temporary_folder("test")) {}
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }

  const std::string& path() const { return path_; }

  // Path of a file in the folder; creates parent folders.
  std::string file(const std::string& name) const {
    const std::filesystem::path full = std::filesystem::path(path_) / name;
    std::filesystem::create_directories(full.parent_path());
    return full.string();
  }

  // Writes a file and returns its path.
  std::string write(const std::string& name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    return file(name);
  }

  // Number of files in the folder, at any depth.
  size_t count() const {
    size_t n = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path_))
      n += entry.is_regular_file();
    return n;
  }

 private:
  std::string path_;
};

inline std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Expects f to throw a gflow::Error whose message contains all the parts.
inline void expect_error(const std::function<void()>& f, std::initializer_list<std::string> parts) {
  try {
    f();
  } catch (const gflow::Error& error) {
    for (const std::string& part : parts)
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos)
          << "'" << part << "' is not in: " << error.what();
    return;
  }
  ADD_FAILURE() << "no error";
}
