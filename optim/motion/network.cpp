// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/network.hpp"

#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "shared/motion/network.h"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kWeightsGroup = 64;

size_t weights_before_last(const NetworkShape& s) {
  return network_weights(uint(s.features), uint(s.hidden), s.layers);
}
size_t all_weights(const NetworkShape& s) {
  return weights_before_last(s) + size_t(s.hidden + 1) * NETWORK_OUTPUTS;
}

}  // namespace

TableSpec network_table(const NetworkShape& shape) {
  TableSpec table;
  table.groups = {{"network", 1, Quantity::network, 0, true}};
  table.rows = all_weights(shape);
  return table;
}

std::vector<float> first_weights(const NetworkShape& s, uint32_t seed) {
  std::vector<float> weights(all_weights(s));
  size_t w = 0;
  for (int layer = 0; layer < s.layers; ++layer) {
    const size_t inputs = size_t(layer ? s.hidden : s.features);
    const double bound = std::sqrt(6.0 / double(inputs));
    for (const size_t end = w + inputs * size_t(s.hidden); w < end; ++w)
      weights[w] = float(bound * (2 * random_uniform(seed, streams::kNetwork, uint(w)) - 1));
    w += size_t(s.hidden);  // biases
  }
  return weights;
}

bool gives_zero(const NetworkShape& shape, const std::vector<float>& weights) {
  return std::all_of(weights.begin() + long(weights_before_last(shape)), weights.end(),
                     [](float x) { return x == 0; });
}

Defines network_defines(const NetworkShape& s) {
  return {{"FEATURES", s.features}, {"HIDDEN", s.hidden}, {"LAYERS", s.layers}};
}

NetworkBackward::NetworkBackward(Program& program, const NetworkShape& shape, int lanes)
    : shape_(shape),
      weights_(all_weights(shape)),
      gpu_(lanes == 1),
      transpose_(program, "network_transpose"),
      bwd_weights_(program, "network_bwd_weights"),
      sum_(program, "network_sum") {}

void NetworkBackward::begin(Queue& queue, const Buffer<float>& weights, size_t n,
                            const Chunks& chunks) {
  n_ = n;
  chunks_ = chunks;
  transposed_.ensure(queue, weights_);
  transpose_(queue, Range::over(weights_, kWeightsGroup), weights, transposed_);
  sums_.ensure(queue, chunks.count * weights_);
  const size_t kept = size_t(shape_.features) + 2 * size_t(shape_.layers * shape_.hidden);
  kept_.ensure(queue, gpu_ ? n * (kept + NETWORK_OUTPUTS) : 0);
}

void NetworkBackward::finish(Queue& queue, const Buffer<cl_uint>& used, Table& table) {
  if (gpu_)
    bwd_weights_(queue, Range::groups(chunks_.count * weights_, 1), cl_uint(n_), chunks_.length,
                 used, kept_, sums_);
  sum_(queue, Range::over(weights_, kWeightsGroup), chunks_.count, sums_, table.rows.seen,
       table.groups[0].grads);
  table.active = {0, weights_};
}

}  // namespace gflow
