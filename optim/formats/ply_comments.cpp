// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/ply_comments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "runtime/base/decimal.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {

std::optional<std::string> comment_after(const PlyTable& table, const std::string& start) {
  for (const std::string& comment : table.comments)
    if (comment.rfind(start, 0) == 0) return comment.substr(start.size());
  return std::nullopt;
}

bool is_foreign_comment(const PlyTable& table, const std::string& text) {
  char* end = nullptr;
  std::strtod(text.c_str(), &end);
  return end == text.c_str() && !comment_after(table, model_comment);
}

std::optional<std::vector<double>> only_numbers(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const auto number = decimal_number(word);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  if (numbers.empty()) return std::nullopt;
  return numbers;
}

std::array<double, 3> origin_of(const PlyTable& table, const std::string& path) {
  std::array<double, 3> origin = table.origin;
  const auto text = comment_after(table, "origin ");
  if (!text || is_foreign_comment(table, *text)) return origin;
  constexpr double farthest = 1e30;
  const auto said = only_numbers(*text);
  if (!said || said->size() != 3 ||
      !std::all_of(said->begin(), said->end(), [](double x) { return std::fabs(x) <= farthest; }))
    throw Error(
        fmt::format("cannot read {}: its comment 'origin {}' is damaged; expected three numbers of "
                    "at most {:g}",
                    path, excerpt(*text), farthest));
  for (size_t axis = 0; axis < 3; ++axis) origin[axis] += (*said)[axis];
  return origin;
}

}  // namespace gflow
