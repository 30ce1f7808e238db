// SPDX-License-Identifier: Apache-2.0
// Callbacks by which long work reports to its caller.
#pragma once
#include <cstddef>
#include <functional>
#include <string>

namespace gflow {

// Progress. Called by worker threads, one at a time; an exception ends the work.
using ProgressCallback = std::function<void(size_t done, size_t total)>;

// Receives a sentence about a problem that does not stop the work. Called from any thread.
using Notice = std::function<void(const std::string&)>;

}  // namespace gflow
