// SPDX-License-Identifier: Apache-2.0
#include "optim/density/memory.hpp"

#include <gtest/gtest.h>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

DeviceInfo device_of(uint64_t memory, uint64_t piece) {
  DeviceInfo info;
  info.global_memory = memory;
  info.max_allocation = piece;
  return info;
}

TEST(Memory, EachFloatOfATableCountsEightTimes) {  // value, gradient, two moments; old and new
  Queue queue = test_queue();
  const Parameters narrow(queue, 7, {{"a", 3}}), wide(queue, 7, {{"a", 3}, {"b", 10}});
  EXPECT_EQ(bytes_per_gaussian(wide, true) - bytes_per_gaussian(narrow, true), 10u * 4 * 8);
}

TEST(Memory, WhatKeepsNoMeanGradientTakesAFloatLess) {
  Queue queue = test_queue();
  const Parameters p(queue, 7, {{"a", 3}});
  EXPECT_EQ(bytes_per_gaussian(p, true) - bytes_per_gaussian(p, false), 3u * 4 * 2);
  EXPECT_GT(most_gaussians(device_of(1 << 30, 1 << 30), p, 5, false),
            most_gaussians(device_of(1 << 30, 1 << 30), p, 5, true));
}

TEST(Memory, TablesWithKeysCountByTheirKeysSharedOnesNot) {
  Queue queue = test_queue();
  TableSpec keyed, shared;
  keyed.groups = shared.groups = {{"b", 2}};
  keyed.keys = 6;
  shared.rows = 1000;
  const size_t plain = bytes_per_gaussian(Parameters(queue, 7, {{"a", 3}}), true);
  EXPECT_EQ(bytes_per_gaussian(Parameters(queue, 7, {{"a", 3}}, {shared}), true), plain);
  // Four arrays of two floats and ten words per row (RowState), old and new.
  EXPECT_EQ(bytes_per_gaussian(Parameters(queue, 7, {{"a", 3}}, {keyed}), true),
            plain + 6u * (2 * 4 + 10) * 4 * 2);
}

TEST(Memory, ABudgetIsKeptAndUsedUp) {
  Queue queue = test_queue();
  const Parameters p(queue, 7, {{"a", 50}});
  const size_t each = bytes_per_gaussian(p, true),
               most = most_gaussians(device_of(1 << 30, 1 << 30), p, 5, true);
  EXPECT_LE(most * each, size_t(5) << 20);
  EXPECT_GT((most + 1) * each, size_t(5) << 20);
}

TEST(Memory, WithoutABudgetThreeQuartersOfTheDevice) {
  Queue queue = test_queue();
  const Parameters p(queue, 7, {{"a", 50}});
  EXPECT_EQ(most_gaussians(device_of(8 << 20, 1 << 30), p, 0, true),
            most_gaussians(device_of(1 << 30, 1 << 30), p, 6, true));
}

TEST(Memory, NoArrayExceedsTheLargestPiece) {
  Queue queue = test_queue();
  const Parameters p(queue, 7, {{"a", 500}});
  EXPECT_EQ(most_gaussians(device_of(uint64_t(1) << 40, 1000 * 500 * 4), p, 0, true), 1000u);
}

}  // namespace
}  // namespace gflow
