// SPDX-License-Identifier: Apache-2.0
#include "optim/io/file_name.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(FileName, OfAnythingIsOneNameInTheFolder) {
  EXPECT_EQ(as_file_name("cam 00.png"), "cam 00.png");
  EXPECT_EQ(as_file_name("a/b\\c"), "a_b_c");
  EXPECT_EQ(as_file_name("/etc/passwd"), "_etc_passwd");
  for (const char* name : {"", ".", "..", "../x", ".hidden"})
    EXPECT_EQ(as_file_name(name).rfind("camera", 0), 0u) << name;
  EXPECT_EQ(as_file_name(std::string("a\0b", 3)), "a_b");
  EXPECT_EQ(as_file_name("\x1b]2;a\x07\n\x7f"), "_]2;a___");
  EXPECT_EQ(as_file_name(std::string(5000, 'x')), std::string(100, 'x'));
  std::string umlauts;
  for (int i = 0; i < 101; ++i) umlauts += "\u00fc";
  EXPECT_EQ(as_file_name(umlauts), umlauts.substr(0, 200));  // whole letters
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
