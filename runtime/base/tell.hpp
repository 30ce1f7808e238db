// SPDX-License-Identifier: Apache-2.0
// What is said to people: on stderr what is done, which stops no work where nobody can read it, and
// on stdout what was found.
#pragma once
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

#include "runtime/base/printable.hpp"

namespace gflow {

// As fmt::print; what a terminal would obey, from names of files and folders, is spelt out. What
// programs read (--json) goes by fmt::print.
template <class... Args>
void show(fmt::format_string<Args...> text, Args&&... args) {
  fmt::print("{}", printable_lines(fmt::format(text, std::forward<Args>(args)...)));
}

// As fmt::print(stderr, ...), which throws where that is closed or full.
template <class... Args>
void tell(fmt::format_string<Args...> text, Args&&... args) {
  std::fputs(fmt::format(text, std::forward<Args>(args)...).c_str(), stderr);
}

}  // namespace gflow
