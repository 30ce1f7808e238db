// SPDX-License-Identifier: Apache-2.0
#include "optim/io/printable.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(Printable, WhatATerminalObeysIsSpeltOut) {
  EXPECT_EQ(printable("red \x1b[31m, back\b, end\x7f, nul" + std::string(1, '\0')),
            "red \\x1b[31m, back\\x08, end\\x7f, nul\\x00");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\x9b31m");  // CSI in one character
}

TEST(Printable, TheRestStays) {
  const std::string text = "Gr\xc3\xbc\xc3\x9f\x65 \xe4\xbd\xa0, %s {} \\x1b\n\tnext \xc2";
  EXPECT_EQ(printable(text), text);
}

}  // namespace
}  // namespace gflow
