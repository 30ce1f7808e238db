// SPDX-License-Identifier: Apache-2.0
// The commit that the program was built from.
#pragma once

namespace gflow {

// Short hash, or "unknown" if the build had no git. Defined by apps/package/commit.cmake.
extern const char* const kCommit;

}  // namespace gflow
