// SPDX-License-Identifier: Apache-2.0
// Computed flows by name in a folder of bounded size. Thread-safe. Several processes may share the
// folder: files appear atomically, and a flow that another process removed is recomputed.
#pragma once
#include <mutex>
#include <optional>
#include <string>

#include "optim/flow/packed_flow.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

class FlowFolder {
 public:
  // Creates the folder if it is missing. All flows together take at most `budget` [bytes] and leave
  // at least 1 GiB of the disk free.
  FlowFolder(const std::string& folder, uint64_t budget, Notice notice);

  const std::string& path() const { return folder_; }
  // Whether there is a flow of this name and size, by its header and file length only.
  bool has(const std::string& name, int width, int height) const;
  // Reads a flow and marks it as used now. nullopt if there is none of this size; nullopt and a
  // notice if its file is damaged.
  std::optional<TargetFlow> read(const std::string& name, int width, int height) const;
  // Stores a packed flow and removes the least recently used flows if it does not fit; does nothing
  // if it is larger than all the room. Error if it cannot be written.
  void keep(const std::string& name, const Bytes& flow);

 private:
  std::string file_of(const std::string& name) const;

  std::string folder_;
  uint64_t budget_;
  Notice notice_;
  std::mutex keeping_;
};

}  // namespace gflow
