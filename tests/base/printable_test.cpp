// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/printable.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(Printable, WhatATerminalObeysIsSpeltOut) {
  EXPECT_EQ(printable("red \x1b[31m, back\b, end\x7f, nul" + std::string(1, '\0')),
            "red \\x1b[31m, back\\x08, end\\x7f, nul\\x00");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\x9b31m");  // CSI in one character
  EXPECT_EQ(printable("a\u202egpj.exe \u2069"), "a\\xe2\\x80\\xaegpj.exe \\xe2\\x81\\xa9");
  EXPECT_EQ(printable("\u2029\u202f\u2065\u206a"), "\u2029\u202f\u2065\u206a");
}

TEST(Printable, BytesThatAreNoUtf8AreSpeltOut) {
  EXPECT_EQ(printable("cut \xc2"), "cut \\xc2");
  EXPECT_EQ(printable("\xff\xfe, \xc0\xaf, \xed\xa0\x80 and \x80"),
            "\\xff\\xfe, \\xc0\\xaf, \\xed\\xa0\\x80 and \\x80");
}

TEST(Printable, AnExcerptIsOneShortLine) {
  EXPECT_EQ(excerpt("two\nlines\tand \x1b[31m\xff"), "two\\x0alines\\x09and \\x1b[31m\\xff");
  const std::string u = "\xc3\xbc";
  std::string sixty;
  for (int i = 0; i < 60; ++i) sixty += u;
  EXPECT_EQ(excerpt(sixty), sixty);
  EXPECT_EQ(excerpt(sixty + u), sixty + "...");
  EXPECT_EQ(excerpt(std::string(65536, 'a')), std::string(60, 'a') + "...");
}

TEST(Printable, TheRestStays) {
  const std::string text = "Gr\xc3\xbc\xc3\x9f\x65 \xe4\xbd\xa0, %s {} \\x1b\n\tnext";
  EXPECT_EQ(printable(text), text);
}

}  // namespace
}  // namespace gflow
