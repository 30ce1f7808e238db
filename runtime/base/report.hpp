// SPDX-License-Identifier: Apache-2.0
// How long work tells its caller what there is to tell.
#pragma once
#include <cstddef>
#include <functional>
#include <string>

namespace gflow {

// How far it is. Called by worker threads, one at a time; an exception ends the work.
using ProgressCallback = std::function<void(size_t done, size_t total)>;

// Receives a sentence about what went wrong and does not stop the work; from any thread.
using Notice = std::function<void(const std::string&)>;

}  // namespace gflow
