// SPDX-License-Identifier: Apache-2.0
// Computed flows by name in a folder of bounded size. Thread-safe; several processes may share the
// folder: a file is there whole or not at all, and whoever misses one computes it again.
#pragma once
#include <mutex>
#include <optional>
#include <string>

#include "optim/flow/packed_flow.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

class FlowFolder {
 public:
  // Makes the folder where it is missing. `budget` [bytes]: all its flows together never take more,
  // nor so much that less than 1 GiB of the disk stays free.
  FlowFolder(const std::string& folder, uint64_t budget, Notice notice);

  const std::string& path() const { return folder_; }
  // Whether there is a flow of that name and size, as far as can be told without reading it all.
  bool has(const std::string& name, int width, int height) const;
  // The flow, which counts as used now. Nothing when there is none of that size; nothing, and a
  // notice, when its file is damaged.
  std::optional<TeacherFlow> read(const std::string& name, int width, int height) const;
  // Keeps a packed flow and drops those unused for longest where that takes too much room; keeps
  // none that is larger than all the room. Error when it cannot be written.
  void keep(const std::string& name, const Bytes& flow);

 private:
  std::string file_of(const std::string& name) const;

  std::string folder_;
  uint64_t budget_;
  Notice notice_;
  std::mutex keeping_;
};

}  // namespace gflow
