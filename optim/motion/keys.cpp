// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/keys.hpp"

#include <algorithm>
#include <cmath>

namespace gflow {

KeyWeights key_weights(double t, double duration, int keys) {
  KeyWeights result{0, 1, {1, 0, 0, 0}};
  if (keys < 2) return result;
  double place = std::clamp(t / duration, 0.0, 1.0) * (keys - 1);
  // Snap to the key: the time of a frame is rounded to float.
  if (std::fabs(place - std::round(place)) < 1e-5 * keys) place = std::round(place);
  const int key = std::min(int(place), keys - 2);
  const double f = place - key;
  // Catmull-Rom weights of keys key - 1 .. key + 2
  double w[4] = {0.5 * f * (-1 + f * (2 - f)), 1 + 0.5 * f * f * (-5 + 3 * f),
                 0.5 * f * (1 + f * (4 - 3 * f)), 0.5 * f * f * (f - 1)};
  if (key == 0) {  // extrapolate key -1 linearly
    w[1] += 2 * w[0];
    w[2] -= w[0];
    w[0] = 0;
  }
  if (key + 2 == keys) {
    w[2] += 2 * w[3];
    w[1] -= w[3];
    w[3] = 0;
  }
  int first = 0, last = 3;
  while (w[first] == 0) ++first;
  while (w[last] == 0) --last;
  result = {key - 1 + first, last - first + 1, {}};
  for (int k = first; k <= last; ++k) result.weight[k - first] = float(w[k]);
  return result;
}

float key_rate_scale(int keys, const PaceRule& rule) {
  return std::min(std::pow(std::max(0.5f * float(keys), 1.f), rule.power), rule.most);
}

}  // namespace gflow
