// SPDX-License-Identifier: Apache-2.0
// Field numbers are those of onnx.proto3: ModelProto, GraphProto, NodeProto, AttributeProto and
// TensorProto.
#include "optim/networks/onnx_tensors.hpp"

#include <fmt/format.h>

#include <climits>
#include <cstdint>
#include <limits>

#include "optim/networks/protobuf.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace {

constexpr int deepest = 32;          // nesting of graphs in node attributes
constexpr int most_dimensions = 32;  // OpenCV's limit

size_t count_varints(std::string_view bytes) {
  size_t count = 0;
  for (; !bytes.empty(); ++count) take_varint(bytes);
  return count;
}

// Where the values of a data_type may be: in raw_data, or in a typed field. OpenCV reads no other
// types.
struct Storage {
  uint64_t field;  // float_data 4, int32_data 5, int64_data 7, double_data 10
  size_t size;     // of one value in raw_data [bytes]
};
Storage storage_of(uint64_t data_type) {
  switch (data_type) {
    case 1:  // FLOAT
      return {4, 4};
    case 2:  // UINT8
    case 3:  // INT8
    case 9:  // BOOL
      return {5, 1};
    case 4:   // UINT16
    case 5:   // INT16
    case 10:  // FLOAT16
      return {5, 2};
    case 6:  // INT32
      return {5, 4};
    case 7:  // INT64
      return {7, 8};
    case 11:  // DOUBLE
      return {10, 8};
    default:
      return {0, 0};
  }
}

// Number of values in a field, packed or not.
size_t count_numbers(const MessageField& field) {
  const bool is_packed = field.kind == MessageField::sized;
  switch (field.number) {
    case 4:
      return is_packed ? field.bytes.size() / 4 : field.kind == MessageField::fixed32;
    case 10:
      return is_packed ? field.bytes.size() / 8 : field.kind == MessageField::fixed64;
    default:
      return is_packed ? count_varints(field.bytes) : field.kind == MessageField::varint;
  }
}

struct Tensor {
  std::string_view name, raw;
  uint64_t data_type = 0;
  size_t sizes = 0, elements = 1;
  size_t counts[11] = {};  // number of values in fields 4, 5, 7 and 10
  bool is_elsewhere = false;

  void add_size(uint64_t size) {
    constexpr size_t most = std::numeric_limits<size_t>::max();
    if (++sizes > most_dimensions || size > INT_MAX || (size > 0 && elements > most / 8 / size))
      throw DamagedMessage{};
    elements *= size_t(size);
  }
};

Tensor read_tensor(std::string_view message) {
  Tensor tensor;
  for_fields(message, [&](const MessageField& field) {
    std::string_view bytes = field.bytes;
    switch (field.number) {
      case 1:
        if (field.kind == MessageField::varint) tensor.add_size(field.value);
        while (field.kind == MessageField::sized && !bytes.empty())
          tensor.add_size(take_varint(bytes));
        break;
      case 2:
        if (field.kind == MessageField::varint) tensor.data_type = field.value;
        break;
      case 4:
      case 5:
      case 7:
      case 10:
        tensor.counts[field.number] += count_numbers(field);
        break;
      case 8:
        tensor.name = bytes;
        break;
      case 9:
        if (field.kind == MessageField::sized) tensor.raw = bytes;
        break;
      case 13:
      case 14:
        tensor.is_elsewhere |= field.kind == MessageField::sized || field.value != 0;
        break;
      default:
        break;
    }
  });
  return tensor;
}

void check_tensor(std::string_view message, const std::string& path) {
  const Tensor tensor = read_tensor(message);
  const std::string name = fmt::format("tensor '{}'", excerpt(std::string(tensor.name)));
  if (tensor.is_elsewhere)
    throw Error(
        fmt::format("{} cannot be used: {} has its data in another file, which is not supported; "
                    "save the network as a single file",
                    path, name));
  const Storage storage = storage_of(tensor.data_type);
  if (storage.field == 0) return;
  // OpenCV prefers the typed field if it is not empty.
  const size_t of_its_own = tensor.counts[storage.field];
  const bool is_whole = of_its_own > 0 ? of_its_own == tensor.elements
                                       : tensor.raw.size() == tensor.elements * storage.size;
  if (!is_whole)
    throw Error(fmt::format("{} is damaged: {} should have {} values, but has {}", path, name,
                            tensor.elements,
                            of_its_own > 0 ? of_its_own : tensor.raw.size() / storage.size));
}

void check_graph(std::string_view graph, const std::string& path, int depth);

void check_attribute(std::string_view attribute, const std::string& path, int depth) {
  int tensors = 0;
  for_fields(attribute, [&](const MessageField& field) {
    // Protobuf merges a field that occurs twice.
    if (field.number == 5 && ++tensors > 1) throw DamagedMessage{};
    if (field.number == 5 || field.number == 10) check_tensor(field.bytes, path);
    if (field.number == 6 || field.number == 11) check_graph(field.bytes, path, depth + 1);
  });
}

void check_graph(std::string_view graph, const std::string& path, int depth) {
  if (depth > deepest) throw DamagedMessage{};
  for_fields(graph, [&](const MessageField& field) {
    if (field.number == 5) check_tensor(field.bytes, path);
    if (field.number != 1) return;
    for_fields(field.bytes, [&](const MessageField& of_node) {
      if (of_node.number == 5) check_attribute(of_node.bytes, path, depth);
    });
  });
}

}  // namespace

void require_sound_tensors(std::string_view model, const std::string& path) {
  for_fields(model, [&](const MessageField& field) {
    if (field.number == 7) check_graph(field.bytes, path, 0);
  });
}

}  // namespace gflow
