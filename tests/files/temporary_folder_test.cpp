// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/temporary_folder.hpp"

#include <unistd.h>

#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

TEST(MakeTemporaryFolder, LiesWhereTheVariableSaysOrIsToldWithIt) {
  const TemporaryFolder folder;
  {
    const Environment there("TMPDIR", folder.path());
    const std::string one = make_temporary_folder("test"), other = make_temporary_folder("test");
    EXPECT_EQ(one.rfind(folder.path() + "/gflow-test-", 0), 0u) << one;
    EXPECT_NE(one, other);
    EXPECT_TRUE(std::filesystem::is_directory(one));
  }
  const Environment nowhere("TMPDIR", folder.path() + "/none");
  expect_error([] { make_temporary_folder("test"); },
               {folder.path() + "/none (from TMPDIR)", "No such file", "set TMPDIR to"});
}

TEST(ScratchFolder, IsGoneAtTheEndAndWhenTheProgramEndsAtOnce) {
  const TemporaryFolder folder;
  const Environment there("TMPDIR", folder.path());
  const auto fill = [](const ScratchFolder& scratch) {
    std::filesystem::create_directories(scratch.file("some/folder"));
    std::ofstream(scratch.file("some/folder/file")) << "text";
  };
  const auto is_empty = [&] { return std::filesystem::is_empty(folder.path()); };
  {
    const ScratchFolder scratch("test");
    fill(scratch);
    EXPECT_FALSE(is_empty());
  }
  EXPECT_TRUE(is_empty());
  EXPECT_EXIT(
      {
        const ScratchFolder scratch("test");
        fill(scratch);
        remove_unfinished_files();
        _exit(3);
      },
      testing::ExitedWithCode(3), "");
  EXPECT_TRUE(is_empty());
}

}  // namespace
}  // namespace gflow
