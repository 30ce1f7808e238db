// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/file_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Locks `file`, or closes it and throws FileIsLocked if someone else has the lock. Where locks are
// not supported, as on some network file systems, warns and continues.
void lock_or_close(int file, const std::string& what, std::string (*who)(int)) {
  if (::flock(file, LOCK_EX | LOCK_NB) == 0) return;
  if (errno != EWOULDBLOCK)
    return warn(
        fmt::format("cannot lock {} ({}): another program could write there at the same time", what,
                    std::strerror(errno)));
  const std::string holder = who(file);
  ::close(file);
  throw FileIsLocked(
      fmt::format("{} is being written by {}: wait for it or choose another folder", what, holder));
}

// "process 1234", as its holder wrote it; it may not have written it yet.
std::string holder(int file) {
  char text[16] = {};
  const ssize_t length = ::pread(file, text, sizeof text - 1, 0);
  return length > 0 ? fmt::format("process {}", text) : "another process";
}

}  // namespace

FileLock::FileLock(const std::string& path, const std::string& what)
    : file_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666)) {
  // Through a link the process number would be written into another file.
  if (file_ < 0 && errno == ELOOP)
    throw Error(fmt::format("cannot lock {}: it is a symbolic link; remove it", path));
  if (file_ < 0) throw Error(fmt::format("cannot write {}: {}", path, std::strerror(errno)));
  struct stat info;
  if (::fstat(file_, &info) != 0 || !S_ISREG(info.st_mode)) {
    ::close(file_);
    throw Error(fmt::format("cannot lock {}: it is not a regular file; remove it", path));
  }
  lock_or_close(file_, what, holder);
  // The process number is only for messages, so a full disk is no reason to stop.
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(file_, 0) != 0 || ::pwrite(file_, pid.data(), pid.size(), 0) < 0) errno = 0;
}

FileLock::~FileLock() { ::close(file_); }

FolderLock::FolderLock(const std::string& folder)
    : folder_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (folder_ < 0) throw Error(fmt::format("cannot use {}: {}", folder, std::strerror(errno)));
  lock_or_close(folder_, folder, [](int) { return std::string("another process"); });
}

FolderLock::~FolderLock() { ::close(folder_); }

}  // namespace gflow
