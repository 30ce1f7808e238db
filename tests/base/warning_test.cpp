// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/warning.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gflow {
namespace {

TEST(Warning, GoesToTheInnermostSinkElseToStderr) {
  std::vector<std::string> outer, inner;
  testing::internal::CaptureStderr();
  warn("a");
  {
    const WarningsTo to_outer([&](const std::string& sentence) { outer.push_back(sentence); });
    warn("b");
    {
      const WarningsTo to_inner([&](const std::string& sentence) { inner.push_back(sentence); });
      warn("c");
    }
    warn("d");
  }
  warn("e");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "gflow: warning: a\ngflow: warning: e\n");
  EXPECT_EQ(outer, (std::vector<std::string>{"b", "d"}));
  EXPECT_EQ(inner, (std::vector<std::string>{"c"}));
}

}  // namespace
}  // namespace gflow
