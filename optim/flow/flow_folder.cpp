// SPDX-License-Identifier: Apache-2.0
// A file's modification time is its time of last use. The folder is listed again each time: that
// costs little compared with computing a flow, and includes files of other processes.
#include "optim/flow/flow_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr uint64_t left_free = uint64_t{1} << 30;  // for models and images
constexpr const char* extension = ".flow";

struct Kept {
  fs::file_time_type used;
  fs::path path;
  uint64_t bytes;
};

// Lists the stored flows; skips files that another process removes meanwhile.
std::vector<Kept> all_in(const std::string& folder) {
  std::vector<Kept> files;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    if (entry.path().extension() != extension || is_temporary_name(entry.path().filename()))
      continue;
    Kept kept{fs::last_write_time(entry.path(), failed), entry.path(), 0};
    if (!failed) kept.bytes = fs::file_size(kept.path, failed);
    if (!failed) files.push_back(kept);
  }
  return files;
}

}  // namespace

FlowFolder::FlowFolder(const std::string& folder, uint64_t budget, Notice notice)
    : folder_(folder), budget_(budget), notice_(std::move(notice)) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw Error(fmt::format("cannot create folder {}: {}", folder, failed.message()));
}

std::string FlowFolder::file_of(const std::string& name) const {
  return (fs::path(folder_) / (name + extension)).string();
}

bool FlowFolder::has(const std::string& name, int width, int height) const {
  return holds_packed_flow(file_of(name), width, height);
}

std::optional<TargetFlow> FlowFolder::read(const std::string& name, int width, int height) const {
  const std::string path = file_of(name);
  std::error_code failed;
  if (!fs::exists(path, failed)) return {};
  try {
    TargetFlow target_flow = unpacked(read_file(path), path);
    if (target_flow.flow.width != width || target_flow.flow.height != height) return {};
    fs::last_write_time(path, fs::file_time_type::clock::now(), failed);
    return target_flow;
  } catch (const Error& problem) {
    if (fs::exists(path, failed) && notice_)  // else another process removed it
      notice_(fmt::format("{}; computing this flow again", problem.what()));
    return {};
  }
}

void FlowFolder::keep(const std::string& name, const Bytes& flow) {
  const std::lock_guard<std::mutex> lock(keeping_);
  const std::string path = file_of(name);
  std::vector<Kept> files = all_in(folder_);
  uint64_t used = flow.size();
  for (const Kept& file : files)
    if (file.path != path) used += file.bytes;
  std::error_code failed;
  const fs::space_info disk = fs::space(folder_, failed);
  const uint64_t on_disk = failed ? budget_ : used - flow.size() + disk.available;
  const uint64_t room = std::min(budget_, on_disk > left_free ? on_disk - left_free : 0);
  if (flow.size() > room) return;
  std::sort(files.begin(), files.end(), [](const Kept& a, const Kept& b) {
    return std::tie(a.used, a.path) < std::tie(b.used, b.path);
  });
  for (const Kept& file : files) {
    if (used <= room) break;
    if (file.path == path || !fs::remove(file.path, failed)) continue;
    used -= file.bytes;
  }
  write_file_atomically(path, flow);
}

}  // namespace gflow
