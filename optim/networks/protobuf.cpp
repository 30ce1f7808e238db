// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/protobuf.hpp"

namespace gflow {
namespace {

std::string_view take(std::string_view& bytes, uint64_t count) {
  if (count > bytes.size()) throw DamagedMessage{};
  const std::string_view taken = bytes.substr(0, size_t(count));
  bytes.remove_prefix(size_t(count));
  return taken;
}

}  // namespace

uint64_t take_varint(std::string_view& bytes) {
  uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    if (bytes.empty()) throw DamagedMessage{};
    const auto byte = static_cast<unsigned char>(bytes[0]);
    bytes.remove_prefix(1);
    value |= uint64_t(byte & 127) << shift;
    if (byte < 128) return value;
  }
  throw DamagedMessage{};
}

void for_fields(std::string_view message, const std::function<void(const MessageField&)>& see) {
  while (!message.empty()) {
    const uint64_t key = take_varint(message);
    if (key > UINT32_MAX) throw DamagedMessage{};
    MessageField field{key >> 3, MessageField::Kind(key & 7), {}, 0};
    switch (field.kind) {
      case MessageField::varint:
        field.value = take_varint(message);
        break;
      case MessageField::fixed64:
        field.bytes = take(message, 8);
        break;
      case MessageField::sized: {
        const uint64_t length = take_varint(message);
        field.bytes = take(message, length);
        break;
      }
      case MessageField::fixed32:
        field.bytes = take(message, 4);
        break;
      default:  // groups, which ONNX does not use
        throw DamagedMessage{};
    }
    see(field);
  }
}

std::string_view field_of(std::string_view message, uint64_t number) {
  std::string_view found;
  for_fields(message, [&](const MessageField& field) {
    if (field.number == number && field.kind == MessageField::sized) found = field.bytes;
  });
  return found;
}

}  // namespace gflow
