// SPDX-License-Identifier: Apache-2.0
// The program's version, for what it writes.
#pragma once
#include <fmt/format.h>

#include <string>

#include "apps/common/commit.hpp"

namespace gflow {

// "0.1.0 (commit 1234abcd)".
inline std::string version_text() { return fmt::format("{} (commit {})", GFLOW_VERSION, kCommit); }

}  // namespace gflow
