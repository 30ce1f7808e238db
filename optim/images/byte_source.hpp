// SPDX-License-Identifier: Apache-2.0
// Bytes at a position of a file or of memory, so that headers are parsed by the same code from
// either.
#pragma once
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  // False if there are fewer than n bytes from `position` on.
  virtual bool read(size_t position, uint8_t* to, size_t n) = 0;
  virtual size_t size() const = 0;
};

class FileSource : public ByteSource {
 public:
  // Error if the file cannot be opened.
  explicit FileSource(const std::string& path) {
    require_file(path);
    file_.open(path, std::ios::binary);
    if (!file_) throw Error("cannot read image " + path + ": " + std::strerror(errno));
    size_ = std::filesystem::file_size(path);
  }
  bool read(size_t position, uint8_t* to, size_t n) override {
    file_.clear();
    file_.seekg(std::streamoff(position));
    return bool(file_.read(reinterpret_cast<char*>(to), std::streamsize(n)));
  }
  size_t size() const override { return size_; }

 private:
  std::ifstream file_;
  size_t size_ = 0;
};

class MemorySource : public ByteSource {
 public:
  explicit MemorySource(const Bytes& bytes) : bytes_(bytes) {}
  bool read(size_t position, uint8_t* to, size_t n) override {
    if (position > bytes_.size() || bytes_.size() - position < n) return false;
    std::memcpy(to, bytes_.data() + position, n);
    return true;
  }
  size_t size() const override { return bytes_.size(); }

 private:
  const Bytes& bytes_;
};

}  // namespace gflow
