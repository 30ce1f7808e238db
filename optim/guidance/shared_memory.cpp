// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/shared_memory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "optim/guidance/guidance.hpp"

namespace gflow {

SharedMemory::SharedMemory(size_t bytes) : bytes_(bytes) {
  static std::atomic<int> count{0};
  const auto failed = [&](int code) {
    return GuidanceFailed(fmt::format("cannot share {} MiB of memory with the guidance program: {}",
                                      (bytes >> 20) + 1, std::strerror(code)));
  };
  name_ = fmt::format("/gflow-guidance-{}-{}", getpid(), count++);
  shm_unlink(name_.c_str());  // left by a killed process with the same pid
  file_ = shm_open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file_ < 0) throw failed(errno);
  // Allocate now: otherwise a full /dev/shm would raise SIGBUS at the first write.
  int code = posix_fallocate(file_, 0, off_t(bytes));
  void* const data =
      code == 0 ? mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0) : MAP_FAILED;
  if (code == 0 && data == MAP_FAILED) code = errno;
  if (code != 0) {
    close(file_);
    shm_unlink(name_.c_str());
    throw failed(code);
  }
  data_ = static_cast<std::byte*>(data);
}

SharedMemory::~SharedMemory() {
  forget_name();
  munmap(data_, bytes_);
  close(file_);
}

void SharedMemory::require_whole() const {
  struct stat now {};
  if (fstat(file_, &now) == 0 && size_t(now.st_size) >= bytes_) return;
  throw GuidanceFailed(fmt::format(
      "the guidance program truncated the shared memory to {} of {} bytes; it must not resize it",
      now.st_size, bytes_));
}

void SharedMemory::forget_name() {
  if (named_) shm_unlink(name_.c_str());
  named_ = false;
}

}  // namespace gflow
