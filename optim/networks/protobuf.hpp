// SPDX-License-Identifier: Apache-2.0
// ONNX is protobuf: a message is a row of fields, each a number (field << 3 | kind) and a value.
#pragma once
#include <cstdint>
#include <functional>
#include <string_view>

namespace gflow {

// What is thrown where bytes are no message.
struct DamagedMessage {};

// One field. Of kind varint it is a number, of kinds fixed64 and fixed32 so many bytes, of kind
// sized as many as it says.
struct MessageField {
  enum Kind { varint = 0, fixed64 = 1, sized = 2, fixed32 = 5 };
  uint64_t number = 0;
  Kind kind = varint;
  std::string_view bytes;
  uint64_t value = 0;
};

// Takes a whole number of up to ten bytes from the front.
uint64_t take_varint(std::string_view& bytes);

// Calls see for each field of a message, in its order.
void for_fields(std::string_view message, const std::function<void(const MessageField&)>& see);

// The bytes of one field of a message; the last one's where it comes again.
std::string_view field_of(std::string_view message, uint64_t number);

}  // namespace gflow
