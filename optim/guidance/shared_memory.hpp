// SPDX-License-Identifier: Apache-2.0
// Memory that another process maps by name (POSIX shared memory).
#pragma once
#include <cstddef>
#include <string>

namespace gflow {

class SharedMemory {
 public:
  // New zeroed memory, accessible only by this user. GuidanceFailed if there is no room.
  explicit SharedMemory(size_t bytes);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  std::byte* data() const { return data_; }
  size_t size() const { return bytes_; }
  const std::string& name() const { return name_; }  // "/gflow-...", for shm_open
  // GuidanceFailed if the other process has truncated the memory: accessing it would raise SIGBUS.
  void require_whole() const;
  // Unlinks the name. Existing mappings stay valid, nobody else can open the memory, and nothing is
  // left behind however this process ends.
  void forget_name();

 private:
  std::string name_;
  bool named_ = true;
  size_t bytes_;
  int file_ = -1;
  std::byte* data_ = nullptr;
};

}  // namespace gflow
