// SPDX-License-Identifier: Apache-2.0
// The self-check passes on a correct device and can fail.
#include "optim/engine/self_check.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

TEST(SelfCheck, PassesOnTheTestDeviceInBothWorkGroupShapes) {
  for (const int lanes : {0, 1}) {
    Queue queue = test_queue(lanes);
    const SelfCheck rows = self_check(queue);
    EXPECT_EQ(rows.size(), 6u);
    for (const auto& row : rows)
      EXPECT_TRUE(row.passed) << row.name << ": " << row.value << ", at most " << row.bound;
  }
}

TEST(SelfCheck, ValueAboveItsBoundOrNotANumberFails) {
  EXPECT_TRUE(self_check_row("equal", 3, 3).passed);
  EXPECT_FALSE(self_check_row("above", 3.1, 3).passed);
  EXPECT_FALSE(self_check_row("NaN", std::numeric_limits<double>::quiet_NaN(), 3).passed);
}

}  // namespace
}  // namespace gflow
