// SPDX-License-Identifier: Apache-2.0
// Comments that gflow writes into a PLY. Comments of other programs are free text.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "optim/formats/ply.hpp"

namespace gflow {

constexpr const char* model_comment = "gflow ";  // starts a comment of every file that gflow wrote

// The rest of the first comment that begins with `start`.
std::optional<std::string> comment_after(const PlyTable& table, const std::string& start);

// Whether `text`, found after one of our keywords, belongs to another program: it does not begin
// with a number and gflow did not write the file. In a file of gflow the same text means damage.
bool is_foreign_comment(const PlyTable& table, const std::string& text);

// The numbers in `text`; nullopt if there are none or anything else.
std::optional<std::vector<double>> only_numbers(const std::string& text);

// Origin of the positions: the comment "origin x y z" plus table.origin. Error if the comment is
// damaged; `path` names the file.
std::array<double, 3> origin_of(const PlyTable& table, const std::string& path);

}  // namespace gflow
