// SPDX-License-Identifier: Apache-2.0
// Device memory: round trips, ranges, growth, rejected calls.
#include "runtime/cl/buffer.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/support/device.hpp"
#include "tests/support/environment.hpp"

namespace gflow {
namespace {

std::vector<cl_uint> counting(size_t n) {
  std::vector<cl_uint> data(n);
  std::iota(data.begin(), data.end(), 0u);
  return data;
}

TEST(Buffer, ReadsBackWhatWasWritten) {
  Queue queue = test_queue();
  EXPECT_EQ(Buffer<cl_uint>(queue, counting(1001), "counting").read(queue), counting(1001));
}

TEST(Buffer, ReadsAndWritesRanges) {
  Queue queue = test_queue();
  Buffer<cl_uint> buffer(queue, counting(6), "six");
  buffer.write_range(queue, 2, {70, 80});
  EXPECT_EQ(buffer.read(queue), (std::vector<cl_uint>{0, 1, 70, 80, 4, 5}));
  EXPECT_EQ(buffer.read_range(queue, 3, 2), (std::vector<cl_uint>{80, 4}));
}

TEST(Buffer, WritesWithoutWaitingInOrder) {
  Queue queue = test_queue();
  Buffer<cl_uint> buffer(queue, 1000, "async");
  const auto first = counting(1000), second = std::vector<cl_uint>(1000, 7);
  buffer.write_async(queue, first);
  buffer.write_async(queue, second);
  EXPECT_EQ(buffer.read(queue), second);
}

TEST(Buffer, FillsAndCopies) {
  Queue queue = test_queue();
  Buffer<float> from(queue, 5, "from"), to(queue, {1, 2, 3, 4, 5}, "to");
  from.fill(queue, 9);
  to.copy_range(queue, from, 0, 3, 2);
  EXPECT_EQ(to.read(queue), (std::vector<float>{1, 2, 3, 9, 9}));
  to.copy_from(queue, from);
  EXPECT_EQ(to.read(queue), (std::vector<float>(5, 9)));
}

TEST(Buffer, MayBeEmpty) {
  Queue queue = test_queue();
  Buffer<float> buffer(queue, 0, "nothing");
  buffer.fill(queue, 1);
  buffer.write(queue, {});
  EXPECT_TRUE(buffer.read(queue).empty());
}

TEST(Buffer, GrowsByAQuarterAndOnlyWhenTooSmall) {
  Queue queue = test_queue();
  Buffer<float> buffer("growing");
  buffer.ensure(queue, 100);
  EXPECT_EQ(buffer.size(), 100u);
  EXPECT_EQ(buffer.capacity(), 125u);
  const auto memory = buffer.handle()();
  buffer.ensure(queue, 125);
  EXPECT_EQ(buffer.handle()(), memory);
  EXPECT_EQ(buffer.size(), 125u);
  buffer.ensure(queue, 126);
  EXPECT_GE(buffer.capacity(), 126u);
}

TEST(Buffer, RefusesMoreThanTheDeviceGivesInOnePiece) {
  Queue queue = test_queue();
  try {
    Buffer<float> buffer(queue, queue.info.max_allocation / 4 + 1, "too much");
    FAIL() << "allocated";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()).rfind("allocating too much: ", 0), 0u) << error.what();
    EXPECT_NE(std::string(error.what()).find("allows at most"), std::string::npos) << error.what();
  }
}

TEST(Buffer, RefusesRangesBeyondItsEndByName) {
  Queue queue = test_queue();
  Buffer<float> buffer(queue, 4, "four");
  try {
    buffer.read_range(queue, 3, 2);
    FAIL() << "read";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "reading four [4 x 4 bytes]: 2 elements from element 3 are out of range");
  }
  EXPECT_THROW(buffer.write(queue, {1, 2, 3}), Error);
  EXPECT_THROW(buffer.read_range(queue, 5, size_t(-1)), Error);
}

TEST(Buffer, ExchangesMemoryAndKeepsNames) {
  Queue queue = test_queue();
  Buffer<cl_uint> a(queue, {1, 2}, "a"), b(queue, {3}, "b");
  a.swap_memory(b);
  EXPECT_EQ(a.read(queue), std::vector<cl_uint>{3});
  EXPECT_EQ(a.name(), "a");
}

TEST(Buffer, MemoryWithoutContentsIsPoisonedOnRequest) {
  const Environment wanted("GFLOW_POISON_BUFFERS", "1");
  Queue queue = test_queue();
  for (const float value : Buffer<float>(queue, 3, "floats").read(queue)) EXPECT_NE(value, value);
  for (const cl_ushort value : Buffer<cl_ushort>(queue, 3, "masks").read(queue))
    EXPECT_EQ(value, 0xdead);
  for (const cl_uchar value : Buffer<cl_uchar>(queue, 3, "bytes").read(queue))
    EXPECT_EQ(value, 0xad);

  Buffer<cl_uint> ids(queue, {1, 2, 3}, "ids");
  ids.ensure(queue, 3);  // too small to change anything
  EXPECT_EQ(ids.read(queue), (std::vector<cl_uint>{1, 2, 3}));
  ids.ensure(queue, 2);  // fits into the allocated memory
  EXPECT_EQ(ids.read(queue), (std::vector<cl_uint>{poison, poison}));
  ids.ensure(queue, 5);
  EXPECT_EQ(ids.read(queue), std::vector<cl_uint>(5, poison));
}

TEST(Buffer, IsNotPoisonedWhereThatIsSwitchedOff) {
  const Environment off("GFLOW_POISON_BUFFERS", "0");
  EXPECT_FALSE(test_queue().poisons());
}

}  // namespace
}  // namespace gflow
