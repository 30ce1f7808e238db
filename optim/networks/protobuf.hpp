// SPDX-License-Identifier: Apache-2.0
// Protobuf, the encoding of ONNX: a message is a sequence of fields, each a key (number << 3 |
// kind) and a value.
#pragma once
#include <cstdint>
#include <functional>
#include <string_view>

namespace gflow {

// Thrown if bytes are not a valid message.
struct DamagedMessage {};

// One field. `value` holds a varint; `bytes` holds 8 or 4 bytes of a fixed kind, or the content of
// a sized kind.
struct MessageField {
  enum Kind { varint = 0, fixed64 = 1, sized = 2, fixed32 = 5 };
  uint64_t number = 0;
  Kind kind = varint;
  std::string_view bytes;
  uint64_t value = 0;
};

// Takes a varint of up to ten bytes from the front.
uint64_t take_varint(std::string_view& bytes);

// Calls `see` for each field of a message, in order.
void for_fields(std::string_view message, const std::function<void(const MessageField&)>& see);

// The bytes of a sized field; of the last one if it is repeated.
std::string_view field_of(std::string_view message, uint64_t number);

}  // namespace gflow
