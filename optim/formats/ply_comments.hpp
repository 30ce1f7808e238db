// SPDX-License-Identifier: Apache-2.0
// What gflow says in the comments of a PLY. Comments of others are their own words.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "optim/formats/ply.hpp"

namespace gflow {

constexpr const char* model_comment = "gflow ";  // of a file that gflow wrote

// What follows `start` in the first comment that begins with it.
std::optional<std::string> comment_after(const PlyTable& table, const std::string& start);

// Whether what follows one of our words is another's: it does not begin with a number, and gflow
// did not write the file. In one that it wrote it is damaged.
bool says_nothing(const PlyTable& table, const std::string& text);

// The numbers that make up `text`, and nothing else.
std::optional<std::vector<double>> only_numbers(const std::string& text);

// What positions are relative to: the comment "origin x y z" and, where they are doubles, the
// table's. Error where it is damaged; `path`: the file, for messages.
std::array<double, 3> origin_of(const PlyTable& table, const std::string& path);

}  // namespace gflow
