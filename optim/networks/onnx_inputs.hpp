// SPDX-License-Identifier: Apache-2.0
// Names and sizes of what a network in a .onnx file wants to be given. OpenCV, which runs it, does
// not tell.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace gflow {

struct NetworkInput {
  std::string name;
  std::vector<int64_t> sizes;  // 0 where the file leaves one open
};

// The inputs in the order of the file. Weights that it lists among the inputs are left out. Error
// when the file is missing or no ONNX model, with more than 65536 inputs or one of more than 16
// sizes among it.
std::vector<NetworkInput> onnx_input_list(const std::string& path);
// Their sizes by name.
std::map<std::string, std::vector<int64_t>> onnx_inputs(const std::string& path);

}  // namespace gflow
