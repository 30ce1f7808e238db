// SPDX-License-Identifier: Apache-2.0
// The radix sort against std::stable_sort, in both work-group shapes (lanes 0: the device's own,
// lanes 1: a GPU's).
#include "runtime/primitives/sort.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

using Numbers = std::vector<cl_uint>;

struct Sorted {
  Numbers keys, values;
};

Sorted sorted(const Numbers& keys, int lanes, int bits) {
  Queue queue = test_queue(lanes);
  Numbers values(keys.size());
  std::iota(values.begin(), values.end(), 0u);
  Buffer<cl_uint> key_buffer(queue, keys, "keys"), value_buffer(queue, values, "values");
  RadixSort(queue).sort(queue, key_buffer, value_buffer, keys.size(), bits);
  return {key_buffer.read(queue), value_buffer.read(queue)};
}

Numbers expected_order(const Numbers& keys, int bits) {
  const uint64_t mask = (uint64_t(1) << bits) - 1;
  Numbers order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](cl_uint a, cl_uint b) { return (keys[a] & mask) < (keys[b] & mask); });
  return order;
}

Numbers random_keys(size_t n, cl_uint range, unsigned seed) {
  std::mt19937 rng(seed);
  Numbers keys(n);
  for (cl_uint& key : keys) key = range ? rng() % range : rng();
  return keys;
}

class SortTest : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, SortTest, testing::Values(0, 1));

TEST_P(SortTest, SortsFourPairs) {
  const Sorted s = sorted({3, 1u << 31, 1, 3}, GetParam(), 32);
  EXPECT_EQ(s.keys, (Numbers{1, 3, 3, 1u << 31}));
  EXPECT_EQ(s.values, (Numbers{2, 0, 3, 1}));
}

TEST_P(SortTest, LeavesNoneAndOneAlone) {
  EXPECT_TRUE(sorted({}, GetParam(), 32).keys.empty());
  EXPECT_EQ(sorted({9}, GetParam(), 32).keys, Numbers{9});
}

TEST_P(SortTest, AgreesWithTheStandardLibraryAtAnyLength) {
  for (const size_t n : {255u, 256u, 257u, 8191u, 100003u}) {
    const Numbers keys = random_keys(n, 0, unsigned(n));
    EXPECT_EQ(sorted(keys, GetParam(), 32).values, expected_order(keys, 32)) << n;
  }
}

TEST_P(SortTest, KeepsTheOrderOfEqualKeys) {
  const Numbers keys = random_keys(50000, 7, 3);
  EXPECT_EQ(sorted(keys, GetParam(), 32).values, expected_order(keys, 32));
}

TEST_P(SortTest, KeepsGreatestKeysApartFromPadding) {
  const Numbers keys(1000, 0xffffffffu);
  EXPECT_EQ(sorted(keys, GetParam(), 32).values, expected_order(keys, 32));
}

TEST_P(SortTest, IgnoresBitsAboveThoseAskedFor) {
  const Numbers keys = random_keys(5000, 0, 4);
  for (const int bits : {0, 1, 11, 12, 17, 31})
    EXPECT_EQ(sorted(keys, GetParam(), bits).values, expected_order(keys, bits)) << bits;
}

TEST_P(SortTest, KeepsNamesAndSizesOfTheBuffers) {
  Queue queue = test_queue(GetParam());
  Buffer<cl_uint> keys(queue, {4, 3, 2, 1, 0}, "keys"), values(queue, {0, 1, 2, 3, 4}, "values");
  RadixSort sort(queue);
  sort.sort(queue, keys, values, 3);
  sort.sort(queue, keys, values, 2, 8);
  EXPECT_EQ(keys.name(), "keys");
  EXPECT_EQ(values.size(), 5u);
  EXPECT_EQ(keys.read_range(queue, 0, 2), (Numbers{2, 3}));
  EXPECT_THROW(sort.sort(queue, keys, values, 6), Error);
}

}  // namespace
}  // namespace gflow
