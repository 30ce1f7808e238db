// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/running_program.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {

bool comes_true(const std::function<bool()>& condition) {
  for (int i = 0; i < 10000 && !condition(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return condition();
}

std::string ending_of_shell(const std::string& script, const std::string& log) {
  RunningProgram program({"/bin/sh", "-c", script}, log);
  EXPECT_TRUE(comes_true([&] { return program.has_ended(); }));
  return ending_of(program.status());
}

}  // namespace

TEST(RunningProgram, TellsHowItEnded) {
  const TemporaryFolder folder;
  const std::string log = folder.path() + "/log";
  EXPECT_EQ(ending_of_shell("exit 3", log), "exited with code 3");
  EXPECT_EQ(ending_of_shell("kill -9 $$", log), "was killed by signal 9 (Killed)");
}

TEST(RunningProgram, AppendsAllOutputToTheLogAndReadsNothing) {
  const TemporaryFolder folder;
  const std::string log = folder.write("log", "first\n");
  ending_of_shell("cat; echo second; echo third >&2", log);
  EXPECT_EQ(contents(log), "first\nsecond\nthird\n");
}

TEST(RunningProgram, ArgumentsAreNotReadByAShell) {
  const TemporaryFolder folder;
  const std::string log = folder.path() + "/log";
  RunningProgram program({"/bin/echo", "$HOME;", "a  b"}, log);
  EXPECT_TRUE(comes_true([&] { return program.has_ended(); }));
  EXPECT_EQ(contents(log), "$HOME; a  b\n");
}

// The second process would write the file a moment later.
TEST(RunningProgram, IsKilledWithItsProcesses) {
  const TemporaryFolder folder;
  const std::string begun = folder.path() + "/begun", late = folder.path() + "/late";
  {
    RunningProgram program(
        {"/bin/sh", "-c", "(echo > " + begun + "; sleep 0.3; echo > " + late + ") & wait"},
        folder.path() + "/log");
    EXPECT_TRUE(comes_true([&] { return std::filesystem::exists(begun); }));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_FALSE(std::filesystem::exists(late));
}

TEST(RunningProgram, OneThatDoesNotExistIsAnError) {
  const TemporaryFolder folder;
  expect_error([&] { RunningProgram({folder.path() + "/none"}, folder.path() + "/log"); },
               {"cannot start", "none", "No such file"});
}

TEST(RunningProgram, ProgramsAreFoundOnPath) {
  const TemporaryFolder folder;
  const std::string plain = folder.write("a/tool", ""), program = folder.write("b/tool", "");
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  const Environment path("PATH", folder.path() + "/a::" + folder.path() + "/b");
  EXPECT_EQ(find_on_path("tool"), program);
  EXPECT_EQ(find_on_path("other"), "");
}
