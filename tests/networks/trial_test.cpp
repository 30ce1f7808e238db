// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/trial.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

TEST(Trial, SaysOfWhatItsCopyDies) {
  for (const int signal : {SIGFPE, SIGSEGV, SIGABRT, SIGKILL})
    EXPECT_EQ(crash_signal_of([&] { std::raise(signal); }), ::strsignal(signal));
}

TEST(Trial, OfWorkThatEndsThereIsNothingToSay) {
  EXPECT_EQ(crash_signal_of([] {}), "");
  EXPECT_EQ(crash_signal_of([] { throw std::runtime_error("told of later"); }), "");
  EXPECT_EQ(crash_signal_of([] { std::raise(SIGINT); }), "");
}

TEST(Trial, NothingItDoesOrSaysIsLeft) {
  int value = 1;
  testing::internal::CaptureStdout();
  crash_signal_of([&] {
    value = 2;
    std::puts("never seen");
    std::fflush(stdout);
  });
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(value, 1);
}

// These handlers remove the unfinished files of this process.
TEST(Trial, DoesNotCallTheHandlersOfThisProcess) {
  const TemporaryFolder folder;
  static std::string path;
  path = folder.write("unfinished", "");
  const auto before = std::signal(SIGFPE, [](int) { std::remove(path.c_str()); });
  EXPECT_EQ(crash_signal_of([] { std::raise(SIGFPE); }), ::strsignal(SIGFPE));
  std::signal(SIGFPE, before);
  EXPECT_EQ(folder.count(), 1u);
}

}  // namespace
}  // namespace gflow
