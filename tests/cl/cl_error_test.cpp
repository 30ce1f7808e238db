// SPDX-License-Identifier: Apache-2.0
// Error messages are sentences.
#include "runtime/cl/cl_error.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(Error, GoesOnBehindTheZerosOfATextFromAFile) {
  const std::string text("a\0\0b\0", 5);
  EXPECT_STREQ(Error("its name is '" + text + "'").what(), "its name is 'a\\0\\0b\\0'");
}

TEST(ClError, SaysWhatWasBeingDoneWhichCallAndItsCodeByName) {
  try {
    cl_call("filling a bath", []() -> void { throw cl::Error(CL_INVALID_VALUE, "clPour"); });
    FAIL() << "no error";
  } catch (const ClError& error) {
    EXPECT_STREQ(error.what(), "filling a bath: clPour returned CL_INVALID_VALUE (-30)");
    EXPECT_EQ(error.code, CL_INVALID_VALUE);
  }
}

TEST(ClError, KnowsEveryCodeOfOpenCl12) {
  for (int code = 0; code >= -68; --code) {
    if (code < -19 && code > -30) continue;  // not assigned
    EXPECT_EQ(std::string(cl_code_name(code)).rfind("CL_", 0), 0u) << code;
  }
  EXPECT_STREQ(cl_code_name(-1001), "CL_PLATFORM_NOT_FOUND_KHR");
  EXPECT_STREQ(cl_code_name(-12345), "an unknown OpenCL error");
}

TEST(ClCall, PassesResultsThrough) {
  EXPECT_EQ(cl_call("adding", [] { return 2 + 3; }), 5);
}

}  // namespace
}  // namespace gflow
