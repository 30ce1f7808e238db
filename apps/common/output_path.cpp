// SPDX-License-Identifier: Apache-2.0
#include "apps/common/output_path.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

#include "optim/runs/run_names.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// The run folder that contains the path among its own files; empty if none. itself: the path may
// also be a run folder.
fs::path run_around(const std::string& path, bool itself) {
  std::string inner;  // the path component below `folder`
  for (fs::path folder = fs::weakly_canonical(path); folder.has_relative_path();
       inner = folder.filename().string(), folder = folder.parent_path())
    if ((inner.empty() ? itself : is_name_of_training(inner)) && is_made_by_training(folder))
      return folder;
  return {};
}

}  // namespace

void require_other_file(const std::string& output, const std::string& input) {
  std::error_code missing;
  if (fs::equivalent(output, input, missing))
    throw Error(fmt::format("writing {}: it is also the input file; choose another name", output));
}

void require_no_file_of_run(const std::string& output) {
  const fs::path run = run_around(output, false);
  if (!run.empty())
    throw Error(fmt::format(
        "writing {}: this path is reserved for the files of the run {}; choose another file",
        output, run.string()));
}

// Tries the write itself, up to the last step. Permissions alone do not suffice: root may write
// anywhere, but not where a file takes the place of a folder, nor in /proc.
void require_writable(const std::string& option, const std::string& path) {
  if (path.empty()) return;
  require_no_file_of_run(path);
  struct Tried {};
  try {
    replace_file(path, [&](const std::string& temporary) {
      if (!(std::ofstream(temporary) << ' ' << std::flush)) throw_write_error(path, errno);
      throw Tried{};
    });
  } catch (const Tried&) {
  } catch (const Error& problem) {
    throw Error(fmt::format("{}: {}", option, problem.what()));
  }
}

void require_no_folder_of_run(const std::string& output) {
  const fs::path run = run_around(output, true);
  if (!run.empty())
    throw Error(
        fmt::format("writing into {}: it belongs to a run; choose another folder, for example {}",
                    output, (run / "images").string()));
}

}  // namespace gflow
