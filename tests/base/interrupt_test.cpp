// SPDX-License-Identifier: Apache-2.0
// Signals: the first sets a flag, the second ends the program, and no state remains.
#include "runtime/base/interrupt.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

class Interrupt : public testing::TestWithParam<int> {
 protected:
  // The tests may run under nohup, which ignores some signals.
  void SetUp() override { former_ = std::signal(GetParam(), SIG_DFL); }
  void TearDown() override { std::signal(GetParam(), former_); }

 private:
  void (*former_)(int) = nullptr;
};

TEST_P(Interrupt, TheFirstSignalOnlyRaisesTheFlag) {
  const InterruptGuard guard;
  EXPECT_FALSE(interrupted());
  std::raise(GetParam());
  EXPECT_TRUE(interrupted());
}

TEST_P(Interrupt, TheSecondSignalEndsTheProgramWithItsExitCode) {
  EXPECT_EXIT(
      {
        const InterruptGuard guard;
        std::raise(GetParam());
        std::raise(GetParam());
      },
      testing::ExitedWithCode(128 + GetParam()),
      "^gflow: interrupted twice and stopped at once\n$");
}

TEST_P(Interrupt, AfterTheGuardTheSignalDoesWhatItDidBefore) {
  EXPECT_EXIT(
      {
        { const InterruptGuard guard; }
        std::raise(GetParam());
      },
      testing::KilledBySignal(GetParam()), "");
}

TEST_P(Interrupt, WhereNothingIsToBeSavedItEndsTheProgramWithASentence) {
  EXPECT_EXIT(
      {
        std::signal(GetParam(), stop_at_once);
        StopSentence stop("first");
        stop.set("interrupted while reading");
        std::raise(GetParam());
      },
      testing::ExitedWithCode(128 + GetParam()), "^gflow: interrupted while reading\n$");
  EXPECT_EXIT(
      {
        { const StopSentence stop("first"); }
        stop_at_once(GetParam());
      },
      testing::ExitedWithCode(128 + GetParam()), "^gflow: interrupted\n$");
}

TEST_P(Interrupt, ASignalIgnoredBeforeStaysIgnored) {
  const auto former = std::signal(GetParam(), SIG_IGN);
  {
    const InterruptGuard guard;
    std::raise(GetParam());
    EXPECT_FALSE(interrupted());
  }
  std::signal(GetParam(), former);
}

TEST_P(Interrupt, ANewGuardForgetsTheFormerSignal) {
  {
    const InterruptGuard guard;
    std::raise(GetParam());
  }
  const InterruptGuard guard;
  EXPECT_FALSE(interrupted());
}

INSTANTIATE_TEST_SUITE_P(Signals, Interrupt, testing::Values(SIGINT, SIGTERM, SIGHUP));

}  // namespace
}  // namespace gflow
