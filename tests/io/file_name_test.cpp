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
