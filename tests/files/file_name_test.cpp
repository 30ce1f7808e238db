// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/file_name.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(FileName, OfAnythingIsOneNameInTheFolder) {
  EXPECT_EQ(as_file_name("cam 00.png"), "cam 00.png");
  EXPECT_EQ(as_file_name("a/b\\c"), "a_b_c");
  EXPECT_EQ(as_file_name("/etc/passwd"), "_etc_passwd");
  for (const char* name : {"", ".", "..", "../x", ".hidden"})
    EXPECT_EQ(as_file_name(name).rfind("camera", 0), 0u) << name;
  EXPECT_EQ(as_file_name("caf\xe9"), "caf\xe9");
  const auto expect_hashed = [](const std::string& name, const std::string& plain) {
    EXPECT_EQ(as_file_name(name).substr(0, plain.size() + 1), plain + "-");
    EXPECT_EQ(as_file_name(name).size(), plain.size() + 17);
  };
  expect_hashed(std::string("a\0b", 3), "a_b");
  expect_hashed("\x1b]2;a\x07\n\x7f\u009b\u202e", "_]2;a_____");
  expect_hashed(std::string(5000, 'x'), std::string(100, 'x'));
  EXPECT_EQ(as_file_name(std::string(100, 'x')), std::string(100, 'x'));
  std::string umlauts;
  for (int i = 0; i < 101; ++i) umlauts += "\u00fc";
  expect_hashed(umlauts, umlauts.substr(0, 200));  // complete characters
  std::string hiragana;
  for (int i = 0; i < 67; ++i) hiragana += "\u3042";
  expect_hashed(hiragana, hiragana.substr(0, 198));  // characters of three bytes; at most 200
}

// Otherwise two cameras would share unpacked video frames.
TEST(FileName, WhatDiffersBehindTheCutOrInControlsDiffers) {
  const std::string long_name(100, 'x');
  EXPECT_NE(as_file_name(long_name + "1"), as_file_name(long_name + "2"));
  EXPECT_NE(as_file_name("a\x01"), as_file_name("a\x02"));
}

TEST(FileName, APathBelowHasFoldersOfItsOwnButLeadsNowhereElse) {
  EXPECT_EQ(path_below("/f", "sub/a"), "/f/sub/a");
  EXPECT_EQ(path_below("/f", "./sub/../a"), "/f/a");
  EXPECT_EQ(path_below("/f", "../a"), "/f/camera.._a");
  EXPECT_EQ(path_below("/f", "sub/../../a"), "/f/sub_.._.._a");
  EXPECT_EQ(path_below("/f", "/etc/a"), "/f/_etc_a");
  EXPECT_EQ(path_below("/f", ""), "/f/camera");
}

}  // namespace
}  // namespace gflow
