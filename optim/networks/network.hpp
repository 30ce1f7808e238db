// SPDX-License-Identifier: Apache-2.0
// A network from an ONNX file, run by OpenCV's dnn module. No other file uses that module.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "optim/networks/onnx_inputs.hpp"
#include "runtime/base/error.hpp"

namespace gflow {

// An input tensor: values in row-major order.
struct NetworkValues {
  std::vector<int> shape;
  std::vector<float> values;
};

// OpenCV's message when a network fails on its inputs.
struct NetworkFailed : Error {
  using Error::Error;
};

class Network {
 public:
  // Error if the file is missing or damaged, if OpenCV cannot load it or crashes (tried in a forked
  // process first), or if gflow was built without OpenCV's dnn module.
  explicit Network(const std::string& path);
  ~Network();
  Network(Network&&) noexcept;
  Network& operator=(Network&&) noexcept;

  const std::string& path() const { return path_; }
  const std::vector<NetworkInput>& inputs() const { return inputs_; }

  // The values of the first output. `values` has one entry per input, in the order of inputs().
  // NetworkFailed if OpenCV throws.
  std::vector<float> run(const std::vector<NetworkValues>& values);

 private:
  struct State;
  std::string path_;
  std::vector<NetworkInput> inputs_;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
