// SPDX-License-Identifier: Apache-2.0
// A network of a motion model (shared/motion/network.h) in double, written from its formulas.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

#include "shared/motion/network.h"

namespace gflow::reference {

// The inputs of each layer, beginning with `features`, and the outputs of the last.
inline std::vector<std::vector<double>> network_layers(int hidden, int layers,
                                                       const std::vector<double>& w,
                                                       std::vector<double> features) {
  std::vector<std::vector<double>> x{std::move(features)};
  size_t next = 0;
  for (int layer = 0; layer <= layers; ++layer) {
    const std::vector<double>& in = x.back();
    std::vector<double> out(layer == layers ? NETWORK_OUTPUTS : size_t(hidden));
    for (size_t j = 0; j < out.size(); ++j) {
      double sum = w[next + in.size() * out.size() + j];
      for (size_t k = 0; k < in.size(); ++k) sum += in[k] * w[next + k * out.size() + j];
      out[j] = layer == layers ? sum : std::max(sum, 0.0);
    }
    next += (in.size() + 1) * out.size();
    x.push_back(out);
  }
  return x;
}

// Adds the gradient of sum(outputs x v) by the weights to v_w and returns that by the features.
// x: of network_layers().
inline std::vector<double> network_vjp(const std::vector<double>& w,
                                       const std::vector<std::vector<double>>& x,
                                       std::vector<double> v, std::vector<double>& v_w) {
  size_t next = w.size();
  for (size_t layer = x.size() - 1; layer-- > 0;) {
    const std::vector<double>& in = x[layer];
    next -= (in.size() + 1) * v.size();
    std::vector<double> v_in(in.size());
    for (size_t j = 0; j < v.size(); ++j) {
      v_w[next + in.size() * v.size() + j] += v[j];
      for (size_t k = 0; k < in.size(); ++k) {
        v_w[next + k * v.size() + j] += in[k] * v[j];
        if (layer == 0 || in[k] > 0) v_in[k] += w[next + k * v.size() + j] * v[j];
      }
    }
    v = v_in;
  }
  return v;
}

}  // namespace gflow::reference
