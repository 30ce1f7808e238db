// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/wrapped.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

using Lines = std::vector<std::string>;

TEST(Wrapped, LinesHaveAtMostTheWidth) {
  EXPECT_EQ(wrapped("one two three", 7), (Lines{"one two", "three"}));
  EXPECT_EQ(wrapped("one two three", 6), (Lines{"one", "two", "three"}));
  EXPECT_EQ(wrapped("one two three", 13), (Lines{"one two three"}));
}

TEST(Wrapped, TheIndentCountsAndTheFirstLineHasNone) {
  EXPECT_EQ(wrapped("a b c d", 3, "  "), (Lines{"a b", "  c", "  d"}));
}

TEST(Wrapped, ALongWordHasALineOfItsOwn) {
  EXPECT_EQ(wrapped("a longer b", 3), (Lines{"a", "longer", "b"}));
  EXPECT_EQ(wrapped("longer", 3), (Lines{"longer"}));
}

TEST(Wrapped, AnEmptyTextIsOneEmptyLine) { EXPECT_EQ(wrapped("", 10), (Lines{""})); }

}  // namespace
}  // namespace gflow
