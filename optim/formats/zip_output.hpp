// SPDX-License-Identifier: Apache-2.0
// An output file that libzip writes an archive to. libzip's own file output creates a temporary
// file of unknown name, which stays behind when a signal ends the program.
#pragma once
#include <zip.h>

#include <string>

#include "runtime/files/descriptor.hpp"

namespace gflow {

class ZipOutput {
 public:
  // Opens and truncates an existing file. Error if it cannot be opened.
  explicit ZipOutput(const std::string& path);
  ~ZipOutput() { zip_error_fini(&error_); }
  ZipOutput(const ZipOutput&) = delete;
  ZipOutput& operator=(const ZipOutput&) = delete;

  // A new archive in the file, to be closed or discarded before this object is destroyed. bad_alloc
  // if out of memory.
  zip_t* open();

 private:
  static zip_int64_t answer(void* self, void* data, zip_uint64_t length, zip_source_cmd_t command);
  zip_int64_t answer(void* data, zip_uint64_t length, zip_source_cmd_t command);
  // Returns `result` if >= 0; else passes errno to libzip and returns -1.
  zip_int64_t checked(zip_int64_t result);
  zip_int64_t write(const char* bytes, zip_uint64_t length);
  zip_int64_t seek(void* data, zip_uint64_t length);

  Descriptor file_;
  zip_error_t error_;
};

}  // namespace gflow
