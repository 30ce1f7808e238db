// SPDX-License-Identifier: Apache-2.0
// A file that libzip writes an archive to. By itself libzip writes another file beside it, of a
// name that nobody knows, and it stays there when a signal ends the program.
#pragma once
#include <zip.h>

#include <string>

#include "runtime/files/descriptor.hpp"

namespace gflow {

class ZipOutput {
 public:
  // A file that is there; what it holds goes. Error where it cannot be opened.
  explicit ZipOutput(const std::string& path);
  ~ZipOutput() { zip_error_fini(&error_); }
  ZipOutput(const ZipOutput&) = delete;
  ZipOutput& operator=(const ZipOutput&) = delete;

  // A new archive in it, to be closed or discarded before this goes. bad_alloc without memory.
  zip_t* open();

 private:
  static zip_int64_t answer(void* self, void* data, zip_uint64_t length, zip_source_cmd_t command);
  zip_int64_t answer(void* data, zip_uint64_t length, zip_source_cmd_t command);
  // -1, and what of the system went wrong is known to libzip; `result` where it is not below 0.
  zip_int64_t checked(zip_int64_t result);
  zip_int64_t write(const char* bytes, zip_uint64_t length);
  zip_int64_t seek(void* data, zip_uint64_t length);

  Descriptor file_;
  zip_error_t error_;
};

}  // namespace gflow
