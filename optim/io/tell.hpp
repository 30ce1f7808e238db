// SPDX-License-Identifier: Apache-2.0
// What is done, on stderr, for whoever looks on. That nobody can read it stops no work.
#pragma once
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace gflow {

// As fmt::print(stderr, ...), which throws where that is closed or full.
template <class... Args>
void tell(fmt::format_string<Args...> text, Args&&... args) {
  std::fputs(fmt::format(text, std::forward<Args>(args)...).c_str(), stderr);
}

}  // namespace gflow
