// SPDX-License-Identifier: Apache-2.0
// What a library may die of, tried in a copy of this process first.
#pragma once
#include <functional>
#include <string>

namespace gflow {

// Runs `work` in a copy of this process and says of what the copy dies, in the system's words; "":
// it comes to an end, if by an exception, or it is interrupted. Nothing of what it does is left,
// and what it prints is not seen. Work that keeps to its own thread: the copy has no others.
std::string dies_of(const std::function<void()>& work);

}  // namespace gflow
