// SPDX-License-Identifier: Apache-2.0
// Memory that another process maps by a name (POSIX shared memory).
#pragma once
#include <cstddef>
#include <string>

namespace gflow {

class SharedMemory {
 public:
  // New memory, all 0, that only this user may open. GuidanceFailed when there is no room.
  explicit SharedMemory(size_t bytes);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  std::byte* data() const { return data_; }
  size_t size() const { return bytes_; }
  const std::string& name() const { return name_; }  // "/gflow-...", as shm_open takes it
  // GuidanceFailed where the other process has cut it off: touching what is gone would end us.
  void require_whole() const;
  // Whoever has it keeps it; nobody else finds it, and nothing is left behind however we end.
  void forget_name();

 private:
  std::string name_;
  bool named_ = true;
  size_t bytes_;
  int file_ = -1;
  std::byte* data_ = nullptr;
};

}  // namespace gflow
