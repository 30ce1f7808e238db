// SPDX-License-Identifier: Apache-2.0
// A small network that a motion model evaluates on the device (kernels/shared/motion/network.h).
// Its weights are a table of the model.
#pragma once
#include <vector>

#include "optim/motion/parameters.hpp"
#include "runtime/cl/chunks.hpp"
#include "runtime/cl/program.hpp"

namespace gflow {

struct NetworkShape {
  int features = 0;  // inputs, a multiple of 16
  int hidden = 64;   // neurons per hidden layer
  int layers = 2;    // number of hidden layers
};

// "network" [weights, 1].
TableSpec network_table(const NetworkShape& shape);
// Initial weights: hidden layers uniform in +-sqrt(6 / inputs) (He et al. 2015), last layer 0.
std::vector<float> first_weights(const NetworkShape& shape, uint32_t seed);
// Whether the last layer is 0.
bool gives_zero(const NetworkShape& shape, const std::vector<float>& weights);
// FEATURES, HIDDEN and LAYERS of kernels/motion/network.cl.
Defines network_defines(const NetworkShape& shape);

// Backward pass of a network whose inputs and outputs belong to a model's own kernel. That kernel
// gets transposed(), sums() and kept(), and one work-item per chunk of a CPU, or per input on a
// GPU.
class NetworkBackward {
 public:
  // program: has kernels/motion/network.cl.
  NetworkBackward(Program& program, const NetworkShape& shape, int lanes);

  // Prepares for `n` inputs in `chunks` (of a CPU, where each has its own sum).
  void begin(Queue& queue, const Buffer<float>& weights, size_t n, const Chunks& chunks);
  const Buffer<float>& transposed() const { return transposed_; }  // [weights]
  Buffer<float>& sums() { return sums_; }                          // [chunks, weights]
  Buffer<float>& kept() { return kept_; }                          // [n, ...] on a GPU
  // Adds the gradients of the weights to the table. used [n]: whether each input took part.
  void finish(Queue& queue, const Buffer<cl_uint>& used, Table& table);

 private:
  NetworkShape shape_;
  size_t weights_, n_ = 0;
  bool gpu_;
  Chunks chunks_{};
  Kernel<In<float>, Out<float>> transpose_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<float>, Out<float>> bwd_weights_;
  Kernel<cl_uint, In<float>, Out<cl_uint>, Out<float>> sum_;
  Buffer<float> transposed_{"network transposed"}, sums_{"v_networks"}, kept_{"network kept"};
};

}  // namespace gflow
