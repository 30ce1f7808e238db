// SPDX-License-Identifier: Apache-2.0
// Names and shapes of the inputs of an ONNX network, which OpenCV does not report.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace gflow {

struct NetworkInput {
  std::string name;
  std::vector<int64_t> sizes;  // 0 if the file leaves the size open
};

// The inputs in the order of the file, without weights listed among them. Error if the file is
// missing, is not an ONNX model with inputs, or has more than 65536 inputs or one of more than 16
// dimensions.
std::vector<NetworkInput> onnx_input_list(const std::string& path);
// Shapes by name.
std::map<std::string, std::vector<int64_t>> onnx_inputs(const std::string& path);

}  // namespace gflow
