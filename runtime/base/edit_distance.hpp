// SPDX-License-Identifier: Apache-2.0
// The distance between a mistyped word and an existing one.
#pragma once
#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

namespace gflow {

// Levenshtein distance: the fewest letters inserted, removed or replaced. Each letter beyond the
// first hundred counts as missing: names are shorter, but a word from a file may have millions.
inline size_t edit_distance(const std::string& whole_a, const std::string& whole_b) {
  constexpr size_t longest = 100;
  const std::string a = whole_a.substr(0, longest), b = whole_b.substr(0, longest);
  const size_t beyond = (whole_a.size() - a.size()) + (whole_b.size() - b.size());
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0]++;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back() + beyond;
}

}  // namespace gflow
