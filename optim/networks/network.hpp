// SPDX-License-Identifier: Apache-2.0
// A network in an ONNX file, run by OpenCV's dnn module, of which no other file knows.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "optim/networks/onnx_inputs.hpp"
#include "runtime/base/error.hpp"

namespace gflow {

// What a network is given: values in rows, the last index fastest.
struct NetworkValues {
  std::vector<int> shape;
  std::vector<float> values;
};

// OpenCV's own words on why it could not run a network on what it was given.
struct NetworkFailed : Error {
  using Error::Error;
};

class Network {
 public:
  // Error when the file is missing or damaged, OpenCV cannot run it or dies of it (which is tried
  // in a copy of this process), and when gflow was built without OpenCV's dnn module.
  explicit Network(const std::string& path);
  ~Network();
  Network(Network&&) noexcept;
  Network& operator=(Network&&) noexcept;

  const std::string& path() const { return path_; }
  const std::vector<NetworkInput>& inputs() const { return inputs_; }

  // The values of its first output; `values` in the order of inputs(), as many. NetworkFailed.
  std::vector<float> run(const std::vector<NetworkValues>& values);

 private:
  struct State;
  std::string path_;
  std::vector<NetworkInput> inputs_;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
