// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/zip_output.hpp"

#include <fcntl.h>

#include <cerrno>
#include <new>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

ZipOutput::ZipOutput(const std::string& path)
    : file_(::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC)) {
  zip_error_init(&error_);
  if (file_.get() < 0) throw_write_error(path, errno);
}

zip_t* ZipOutput::open() {
  zip_source_t* source = zip_source_function_create(answer, this, &error_);
  zip_t* archive = source ? zip_open_from_source(source, ZIP_TRUNCATE, &error_) : nullptr;
  if (!archive) {  // zip_open_from_source did not take ownership
    if (source) zip_source_free(source);
    throw std::bad_alloc();
  }
  return archive;
}

zip_int64_t ZipOutput::answer(void* self, void* data, zip_uint64_t length,
                              zip_source_cmd_t command) {
  return static_cast<ZipOutput*>(self)->answer(data, length, command);
}

zip_int64_t ZipOutput::checked(zip_int64_t result) {
  if (result >= 0) return result;
  zip_error_set(&error_, ZIP_ER_WRITE, errno);
  return -1;
}

zip_int64_t ZipOutput::write(const char* bytes, zip_uint64_t length) {
  for (zip_uint64_t done = 0; done < length;) {
    const ssize_t written = ::write(file_.get(), bytes + done, length - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return checked(-1);
    done += zip_uint64_t(written);
  }
  return zip_int64_t(length);
}

zip_int64_t ZipOutput::seek(void* data, zip_uint64_t length) {
  const auto* to = ZIP_SOURCE_GET_ARGS(zip_source_args_seek_t, data, length, &error_);
  if (!to) return -1;
  return checked(::lseek(file_.get(), to->offset, to->whence)) < 0 ? -1 : 0;
}

zip_int64_t ZipOutput::answer(void* data, zip_uint64_t length, zip_source_cmd_t command) {
  switch (command) {
    case ZIP_SOURCE_SUPPORTS:
      return zip_source_make_command_bitmap(
          ZIP_SOURCE_OPEN, ZIP_SOURCE_READ, ZIP_SOURCE_CLOSE, ZIP_SOURCE_STAT, ZIP_SOURCE_ERROR,
          ZIP_SOURCE_FREE, ZIP_SOURCE_SEEK, ZIP_SOURCE_TELL, ZIP_SOURCE_BEGIN_WRITE,
          ZIP_SOURCE_WRITE, ZIP_SOURCE_SEEK_WRITE, ZIP_SOURCE_TELL_WRITE, ZIP_SOURCE_COMMIT_WRITE,
          ZIP_SOURCE_ROLLBACK_WRITE, ZIP_SOURCE_REMOVE, -1);
    case ZIP_SOURCE_STAT: {
      auto* stat = static_cast<zip_stat_t*>(data);
      zip_stat_init(stat);
      stat->size = 0;
      stat->valid = ZIP_STAT_SIZE;
      return sizeof *stat;
    }
    case ZIP_SOURCE_ERROR:
      return zip_error_to_data(&error_, data, length);
    case ZIP_SOURCE_WRITE:
      return write(static_cast<const char*>(data), length);
    case ZIP_SOURCE_SEEK_WRITE:
      return seek(data, length);
    case ZIP_SOURCE_TELL_WRITE:
      return checked(::lseek(file_.get(), 0, SEEK_CUR));
    case ZIP_SOURCE_COMMIT_WRITE:
      return checked(file_.close() ? 0 : -1);
    default:  // begin, rollback, free: nothing to do; read: the file is empty
      return 0;
  }
}

}  // namespace gflow
