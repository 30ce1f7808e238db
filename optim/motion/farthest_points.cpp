// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/farthest_points.hpp"

#include <algorithm>
#include <limits>

namespace gflow {

double squared_distance(const std::vector<float>& xyz, size_t i, size_t j) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double d = double(xyz[3 * i + c]) - double(xyz[3 * j + c]);
    sum += d * d;
  }
  return sum;
}

std::vector<size_t> farthest_points(const std::vector<float>& xyz, size_t first, size_t end,
                                    size_t count) {
  if (first >= end) first = 0;
  std::vector<size_t> chosen;
  std::vector<double> nearest(end, std::numeric_limits<double>::max());
  for (size_t next = first; end > 0 && chosen.size() < count;) {
    chosen.push_back(next);
    next = first;
    for (size_t i = first; i < end; ++i) {
      nearest[i] = std::min(nearest[i], squared_distance(xyz, i, chosen.back()));
      if (nearest[i] > nearest[next]) next = i;
    }
    if (nearest[next] == 0) break;  // the others repeat chosen ones
  }
  return chosen;
}

}  // namespace gflow
