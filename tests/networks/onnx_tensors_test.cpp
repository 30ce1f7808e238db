// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/onnx_tensors.hpp"

#include <gtest/gtest.h>

#include "optim/networks/network.hpp"
#include "optim/networks/protobuf.hpp"
#include "tests/support/protobuf_message.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr int kFloat = 1, kUint8 = 2, kInt64 = 7, kFloat16 = 10, kDouble = 11;

// A tensor of 2 x 3 values, stored as `kept`.
std::string tensor(int data_type, const std::string& kept) {
  return field(1, 2) + field(1, 3) + field(2, data_type) + field(8, "w") + kept;
}
std::string weights(const std::string& tensor) { return field(7, field(5, tensor)); }
std::string attribute(const std::string& of_attribute) {
  return field(7, field(1, field(5, of_attribute)));
}
std::string raw(size_t bytes) { return field(9, std::string(bytes, 'x')); }

void expect_sound(const std::string& model) {
  EXPECT_NO_THROW(require_sound_tensors(model, "a.onnx"));
}
void expect_refused(const std::string& model, const std::string& why) {
  expect_error([&] { require_sound_tensors(model, "a.onnx"); }, {"a.onnx", why});
}

TEST(OnnxTensors, HoldAsManyBytesAsTheirSizesSay) {
  for (const auto& [type, size] :
       {std::pair{kFloat, 4}, {kUint8, 1}, {kInt64, 8}, {kFloat16, 2}, {kDouble, 8}}) {
    const size_t whole = size_t(6 * size);
    expect_sound(weights(tensor(type, raw(whole))));
    for (const size_t bytes : {size_t{0}, whole - 1, whole + 1})
      expect_refused(weights(tensor(type, raw(bytes))), "tensor 'w' should have 6 values");
  }
  expect_refused(weights(tensor(kFloat, "")), "6 values, but has 0");
}

TEST(OnnxTensors, HoldAsManyNumbersOfTheirTypeAsTheirSizesSay) {
  const auto floats = [](size_t n) { return field(4, std::string(4 * n, 'x')); };
  const auto whole = [](size_t n) { return field(7, std::string(n, '\1')); };
  const auto doubles = [](size_t n) { return field(10, std::string(8 * n, 'x')); };
  const std::string one_float = std::string{char(4 << 3 | 5)} + "xxxx";
  expect_sound(weights(tensor(kFloat, floats(6))));
  expect_sound(weights(tensor(kFloat, floats(4) + one_float + one_float)));
  expect_sound(weights(tensor(kInt64, whole(6))));
  expect_sound(weights(tensor(kInt64, whole(5) + field(7, 9))));
  expect_sound(weights(tensor(kDouble, doubles(6))));
  expect_refused(weights(tensor(kFloat, floats(5))), "but has 5");
  expect_refused(weights(tensor(kInt64, whole(7))), "but has 7");
  // Values of another type are ignored, and raw data is ignored if there are typed values.
  expect_refused(weights(tensor(kFloat, whole(6))), "but has 0");
  expect_refused(weights(tensor(kFloat, floats(1) + raw(24))), "but has 1");
  // A wrong wire type makes them no floats.
  expect_refused(weights(tensor(kFloat, floats(4) + std::string{char(4 << 3 | 1)} + "xxxxxxxx")),
                 "but has 4");
}

TEST(OnnxTensors, InAttributesOfNodesAreLookedAtToo) {
  const std::string sound = tensor(kFloat, raw(24)), short_one = tensor(kFloat, raw(4));
  expect_sound(attribute(field(5, sound)));
  expect_refused(attribute(field(5, short_one)), "tensor 'w'");
  expect_refused(attribute(field(10, short_one)), "tensor 'w'");
  const auto graph_with = [&](const std::string& inner) { return field(6, field(5, inner)); };
  expect_sound(attribute(graph_with(sound)));
  expect_refused(attribute(graph_with(short_one)), "tensor 'w'");
  // Two tensors in one field would be merged: dimensions of both, values of the last.
  const std::string one = field(1, 1) + field(2, kFloat) + raw(4);
  EXPECT_THROW(require_sound_tensors(attribute(field(5, one) + field(5, one)), "a.onnx"),
               DamagedMessage);
}

TEST(OnnxTensors, OfNoElementsNeedNoNumbers) {
  expect_sound(weights(field(1, 0) + field(2, kFloat)));
}

TEST(OnnxTensors, InAnotherFileAreNotRead) {
  const std::string location = field(13, field(1, "location") + field(2, "/etc/passwd"));
  expect_refused(weights(tensor(kFloat, location + field(14, 1))), "in another file");
}

TEST(OnnxTensors, OfMoreThanMemoryHoldsAreNone) {
  const std::string large = std::string{char(1 << 3)} + "\xff\xff\xff\xff\x07";  // 2^31 - 1
  std::string sizes;
  for (int i = 0; i < 3; ++i) sizes += large;
  EXPECT_THROW(require_sound_tensors(weights(sizes), "a.onnx"), DamagedMessage);
  const std::string negative =
      std::string{char(1 << 3)} + "\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01";
  EXPECT_THROW(require_sound_tensors(weights(negative), "a.onnx"), DamagedMessage);
}

TEST(OnnxTensors, OfGraphsWithinGraphsEndSomewhere) {
  std::string graph;
  for (int depth = 0; depth < 8; ++depth) graph = field(1, field(5, field(6, graph)));
  expect_sound(field(7, graph));
  std::string deep;
  const auto long_field = [](int number, const std::string& bytes) {
    return std::string{char(number << 3 | 2), char((bytes.size() & 127) | 128),
                       char(bytes.size() >> 7)} +
           bytes;
  };
  for (int depth = 0; depth < 40; ++depth) deep = long_field(1, long_field(5, long_field(6, deep)));
  EXPECT_THROW(require_sound_tensors(long_field(7, deep), "a.onnx"), DamagedMessage);
}

// Files that crash OpenCV 4.6. Other versions may read them.
TEST(Networks, ThatOpenCvDiesOfAreRefused) {
  for (const char* name : {"crashes_opencv.onnx", "divides_by_zero.onnx"}) {
    const std::string path = GFLOW_SOURCE_DIR "/tests/data/networks/" + std::string(name);
    try {
      const Network network(path);
    } catch (const Error& problem) {
      EXPECT_NE(std::string(problem.what()).find(name), std::string::npos) << problem.what();
    }
  }
}

}  // namespace
}  // namespace gflow
