// SPDX-License-Identifier: Apache-2.0
// The progress line: its text, and its parts that are dropped in a narrow terminal.
#include "runtime/base/progress.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "tests/support/environment.hpp"

namespace gflow {
namespace {

TEST(Progress, DurationsReadLikeAClock) {
  EXPECT_EQ(duration_text(0), "0:00");
  EXPECT_EQ(duration_text(111.4), "1:51");
  EXPECT_EQ(duration_text(3599.6), "1:00:00");
  EXPECT_EQ(duration_text(3729), "1:02:09");
}

TEST(Progress, UnknownDurationsAreDashes) {
  EXPECT_EQ(duration_text(NAN), "-:--");
  EXPECT_EQ(duration_text(INFINITY), "-:--");
  EXPECT_EQ(duration_text(-1), "-:--");
}

TEST(Progress, TheLineTellsCountSpeedTimeLeftAndTerms) {
  // 3000 steps in 100 s: 30 it/s; 9000 to go: 300 s. A quarter of the bar's 24 cells is 6.
  const ProgressState state{"train", 0, 3000, 12000, {{"loss", "0.0213"}, {"", "18234 Gaussians"}}};
  EXPECT_EQ(progress_line(state, 100, 200),
            "train  [######------------------]  3000/12000  30.0 it/s  ETA 5:00  loss 0.0213  "
            "18234 Gaussians");
}

TEST(Progress, AResumedRunCountsItsOwnStepsOnly) {
  // 100 steps in 50 s = 2 it/s; 100 left: 50 s
  const ProgressState state{"train", 800, 900, 1000, {}};
  EXPECT_NE(progress_line(state, 50, 200).find("2.0 it/s  ETA 0:50"), std::string::npos);
}

TEST(Progress, BeforeTheFirstStepNothingIsKnown) {
  const ProgressState state{"train", 0, 0, 10, {}};
  EXPECT_EQ(progress_line(state, 0, 200),
            "train  [------------------------]  0/10  - it/s  ETA -:--");
}

TEST(Progress, AFinishedLineTellsHowLongItTook) {
  const ProgressState state{"flow", 0, 152, 152, {}};
  EXPECT_EQ(progress_line(state, 76, 200),
            "flow  [########################]  152/152  2.0 it/s  in 1:16");
}

TEST(Progress, ATaskOfNoStepsIsComplete) {
  const ProgressState state{"flow", 0, 0, 0, {}};
  EXPECT_NE(progress_line(state, 0, 200).find("0/0"), std::string::npos);
}

TEST(Progress, WhereSpaceIsShortTermsGoFirstThenTheBar) {
  const ProgressState state{"train", 0, 1, 2, {{"loss", "0.5"}, {"psnr", "30"}}};
  const std::string whole = progress_line(state, 1, 200);
  for (size_t width = 0; width <= whole.size(); ++width)
    EXPECT_LE(progress_line(state, 1, width).size(), width);
  EXPECT_EQ(progress_line(state, 1, whole.size() - 1), whole.substr(0, whole.size() - 9));
  EXPECT_EQ(progress_line(state, 1, 40), "train  1/2  1.0 it/s  ETA 0:01  loss 0.5");
  EXPECT_EQ(progress_line(state, 1, 19), "1/2  ETA 0:01");
  EXPECT_EQ(progress_line(state, 1, 9), "1/2");
  EXPECT_EQ(progress_line({"train", 0, 1500, 3000, {}}, 1, 5), "50%");
  EXPECT_EQ(progress_line({"train", 0, 1500, 3000, {}}, 1, 2), "");
}

// Output of a one-step progress on a terminal of this kind.
std::string written_to_terminal(const char* kind) {
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
  EXPECT_TRUE(terminal >= 0 && ::grantpt(terminal) == 0 && ::unlockpt(terminal) == 0);
  const int line = ::open(::ptsname(terminal), O_RDWR | O_NOCTTY), former = ::dup(STDERR_FILENO);
  {
    const Environment of_kind("TERM", kind);
    ::dup2(line, STDERR_FILENO);
    Progress progress("render", 1);
    progress.advance();
    progress.print_line("a sentence");
    progress.finish();
    ::dup2(former, STDERR_FILENO);
  }
  std::string text(4096, '\0');
  text.resize(size_t(std::max<ssize_t>(::read(terminal, text.data(), text.size()), 0)));
  for (const int file : {line, former, terminal}) ::close(file);
  return text;
}

TEST(Progress, OnATerminalThatCannotRedrawItIsPlainLines) {
  EXPECT_NE(written_to_terminal("xterm").find("\x1b[K"), std::string::npos);
  const std::string plain = written_to_terminal("dumb");
  EXPECT_NE(plain.find("a sentence"), std::string::npos);
  EXPECT_EQ(plain.find('\x1b'), std::string::npos) << plain;
}

TEST(Progress, IntoAPipeItEndsWithOneWholeLine) {
  testing::internal::CaptureStderr();
  {
    Progress progress("render", 2);
    progress.advance();
    progress.update(2, {{"psnr", "31.2"}});
    progress.finish();
  }
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(text.find("render  [########################]  2/2"), 0u) << text;
  EXPECT_EQ(text.find('\n'), text.size() - 1) << text;
}

TEST(Progress, QuietSaysNothing) {
  testing::internal::CaptureStderr();
  Progress progress("render", 1, true);
  progress.advance();
  progress.finish();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace gflow
