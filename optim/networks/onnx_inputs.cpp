// SPDX-License-Identifier: Apache-2.0
// Reads only model.graph.input.type.tensor_type.shape (onnx.proto3).
#include "optim/networks/onnx_inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "optim/networks/onnx_tensors.hpp"
#include "optim/networks/protobuf.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// An entry of two bytes in the file takes much more memory; these limits keep it to a few MB.
constexpr size_t most_inputs = 65536, most_sizes = 16;

std::vector<int64_t> sizes_of(std::string_view shape) {
  std::vector<int64_t> sizes;
  for_fields(shape, [&](const MessageField& dimension) {
    if (dimension.number != 1) return;
    if (sizes.size() == most_sizes) throw DamagedMessage{};
    int64_t size = 0;
    for_fields(dimension.bytes, [&](const MessageField& field) {
      if (field.number == 1) size = int64_t(field.value);
    });
    sizes.push_back(size);
  });
  return sizes;
}

}  // namespace

std::vector<NetworkInput> onnx_input_list(const std::string& path) {
  const Bytes bytes = read_file(path);
  const std::string_view model(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::vector<NetworkInput> inputs;
  try {
    require_sound_tensors(model, path);
    const std::string_view graph = field_of(model, 7);
    std::set<std::string_view> names;
    for_fields(graph, [&](const MessageField& input) {
      if (input.number != 11) return;
      if (inputs.size() == most_inputs) throw DamagedMessage{};
      const std::string_view name = field_of(input.bytes, 1);
      const std::string_view tensor = field_of(field_of(input.bytes, 2), 1);
      inputs.push_back({std::string(name), sizes_of(field_of(tensor, 2))});
      names.insert(name);
    });
    // Older files list weights among the inputs.
    for_fields(graph, [&](const MessageField& weights) {
      if (weights.number == 5) names.erase(field_of(weights.bytes, 8));
    });
    inputs.erase(
        std::remove_if(inputs.begin(), inputs.end(),
                       [&](const NetworkInput& input) { return names.count(input.name) == 0; }),
        inputs.end());
  } catch (const DamagedMessage&) {
    throw Error(fmt::format("{} is not an ONNX model, or it is damaged", path));
  }
  if (inputs.empty()) throw Error(fmt::format("{} is not an ONNX model with inputs", path));
  return inputs;
}

std::map<std::string, std::vector<int64_t>> onnx_inputs(const std::string& path) {
  std::map<std::string, std::vector<int64_t>> by_name;
  for (const NetworkInput& input : onnx_input_list(path)) by_name[input.name] = input.sizes;
  return by_name;
}

}  // namespace gflow
