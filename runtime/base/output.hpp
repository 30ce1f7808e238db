// SPDX-License-Identifier: Apache-2.0
// Output for people: notices on stderr, which never stop the work if nobody can read them, and
// results on stdout.
#pragma once
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

#include "runtime/base/printable.hpp"

namespace gflow {

// Prints to stdout, with characters that a terminal would obey escaped (they may be in file names).
// Output for programs (--json) uses fmt::print.
template <class... Args>
void print_result(fmt::format_string<Args...> text, Args&&... args) {
  fmt::print("{}", printable_lines(fmt::format(text, std::forward<Args>(args)...)));
}

// Prints to stderr. Unlike fmt::print, does not throw if stderr is closed or full.
template <class... Args>
void print_status(fmt::format_string<Args...> text, Args&&... args) {
  std::fputs(fmt::format(text, std::forward<Args>(args)...).c_str(), stderr);
}

}  // namespace gflow
