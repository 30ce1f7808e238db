// SPDX-License-Identifier: Apache-2.0
// ONNX is protobuf: a message is a row of fields, each a number (field << 3 | kind) and a value.
// Only the path model.graph.input.type.tensor_type.shape is followed (onnx.proto3).
#include "optim/networks/onnx_inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string_view>

#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace {

struct Damaged {};

// An entry of two bytes is kept in many more: so much that no file takes more than a few MB.
constexpr size_t most_inputs = 65536, most_sizes = 16;

uint64_t varint(std::string_view& bytes) {
  uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    if (bytes.empty()) throw Damaged{};
    const auto byte = static_cast<unsigned char>(bytes[0]);
    bytes.remove_prefix(1);
    value |= uint64_t(byte & 127) << shift;
    if (byte < 128) return value;
  }
  throw Damaged{};
}

std::string_view take(std::string_view& bytes, uint64_t count) {
  if (count > bytes.size()) throw Damaged{};
  const std::string_view taken = bytes.substr(0, size_t(count));
  bytes.remove_prefix(size_t(count));
  return taken;
}

// Calls see(field number, bytes, number) for each field; bytes of those with a length, else the
// number.
void for_fields(std::string_view message,
                const std::function<void(uint64_t, std::string_view, uint64_t)>& see) {
  while (!message.empty()) {
    const uint64_t key = varint(message);
    switch (key & 7) {
      case 0:
        see(key >> 3, {}, varint(message));
        break;
      case 1:
        take(message, 8);
        break;
      case 2: {
        const uint64_t length = varint(message);
        see(key >> 3, take(message, length), 0);
        break;
      }
      case 5:
        take(message, 4);
        break;
      default:
        throw Damaged{};
    }
  }
}

// The bytes of one field of a message; the last one's where it comes again.
std::string_view field_of(std::string_view message, uint64_t field) {
  std::string_view found;
  for_fields(message, [&](uint64_t number, std::string_view bytes, uint64_t) {
    if (number == field) found = bytes;
  });
  return found;
}

std::vector<int64_t> sizes_of(std::string_view shape) {
  std::vector<int64_t> sizes;
  for_fields(shape, [&](uint64_t number, std::string_view dimension, uint64_t) {
    if (number != 1) return;
    if (sizes.size() == most_sizes) throw Damaged{};
    int64_t size = 0;
    for_fields(dimension, [&](uint64_t which, std::string_view, uint64_t value) {
      if (which == 1) size = int64_t(value);
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
    const std::string_view graph = field_of(model, 7);
    std::set<std::string_view> names;
    for_fields(graph, [&](uint64_t number, std::string_view value, uint64_t) {
      if (number != 11) return;
      if (inputs.size() == most_inputs) throw Damaged{};
      const std::string_view name = field_of(value, 1);
      inputs.push_back({std::string(name), sizes_of(field_of(field_of(field_of(value, 2), 1), 2))});
      names.insert(name);
    });
    // Older files list their weights among the inputs.
    for_fields(graph, [&](uint64_t number, std::string_view value, uint64_t) {
      if (number == 5) names.erase(field_of(value, 8));
    });
    inputs.erase(
        std::remove_if(inputs.begin(), inputs.end(),
                       [&](const NetworkInput& input) { return names.count(input.name) == 0; }),
        inputs.end());
  } catch (const Damaged&) {
    throw Error(fmt::format("{} is no ONNX model, or it is damaged", path));
  }
  if (inputs.empty()) throw Error(fmt::format("{} is no ONNX model with inputs", path));
  return inputs;
}

std::map<std::string, std::vector<int64_t>> onnx_inputs(const std::string& path) {
  std::map<std::string, std::vector<int64_t>> by_name;
  for (const NetworkInput& input : onnx_input_list(path)) by_name[input.name] = input.sizes;
  return by_name;
}

}  // namespace gflow
