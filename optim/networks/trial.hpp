// SPDX-License-Identifier: Apache-2.0
// Runs library code in a forked process first, to find out whether it crashes.
#pragma once
#include <functional>
#include <string>

namespace gflow {

// Forks, runs `work` in the child, and returns the name of the signal that killed the child; "" if
// it ended (also by an exception) or was interrupted. Side effects and output of the child are
// lost. The child has only one thread, so `work` must not need others.
std::string crash_signal_of(const std::function<void()>& work);

}  // namespace gflow
