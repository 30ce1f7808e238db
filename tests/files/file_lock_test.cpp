// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/file_lock.hpp"

#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {
bool no_locks = false;  // as on a network file system without locks
}

// Replaces the function of the C library.
extern "C" int flock(int file, int operation) {
  if (!no_locks) return int(syscall(SYS_flock, file, operation));
  errno = ENOLCK;
  return -1;
}

TEST(FileLock, ASecondOneIsRefusedWithTheNumberOfTheProcess) {
  const TemporaryFolder folder;
  const FileLock lock(folder.file("lock"), "the folder");
  expect_error([&] { FileLock(folder.file("lock"), "the folder"); },
               {"the folder", "process " + std::to_string(getpid())});
}

TEST(FileLock, EndsWithTheObject) {
  const TemporaryFolder folder;
  { const FileLock lock(folder.file("lock"), "the folder"); }
  EXPECT_NO_THROW(FileLock(folder.file("lock"), "the folder"));
}

TEST(FileLock, EndsWithAProcessThatIsKilled) {
  const TemporaryFolder folder;
  const std::string path = folder.file("lock");
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const FileLock lock(path, "the folder");
    if (write(ready[1], "x", 1) == 1) pause();
    _exit(0);
  }
  char byte;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  expect_error([&] { FileLock(path, "the folder"); }, {"process " + std::to_string(child)});
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_NO_THROW(FileLock(path, "the folder"));
}

TEST(FolderLock, OneAtATimeAndNothingIsLeft) {
  const TemporaryFolder folder;
  {
    const FolderLock lock(folder.path());
    expect_error([&] { FolderLock(folder.path()); }, {folder.path(), "another process"});
  }
  EXPECT_NO_THROW(FolderLock(folder.path()));
  EXPECT_EQ(folder.count(), 0u);
  expect_error([&] { FolderLock(folder.file("none")); }, {"none", "No such file"});
}

TEST(FileLock, WhereNoFileCanBeMadeTheReasonIsSaid) {
  const TemporaryFolder folder;
  expect_error([&] { FileLock(folder.path() + "/none/lock", "the folder"); },
               {"/none/lock", "No such file"});
}

// An untrusted run may contain a link to a valuable file of the user.
TEST(FileLock, WritesIntoNoFileThatALinkLeadsTo) {
  const TemporaryFolder folder;
  folder.write("dear", "precious");
  std::filesystem::create_symlink(folder.path() + "/dear", folder.file("lock"));
  expect_error([&] { FileLock(folder.file("lock"), "the folder"); },
               {"cannot lock", "it is a symbolic link"});
  EXPECT_EQ(contents(folder.path() + "/dear"), "precious");
}

TEST(FileLock, WhereThereAreNoLocksThatIsSaidAndWorkGoesOn) {
  const TemporaryFolder folder;
  no_locks = true;
  testing::internal::CaptureStderr();
  EXPECT_NO_THROW(FileLock(folder.file("lock"), "the folder"));
  const std::string said = testing::internal::GetCapturedStderr();
  no_locks = false;
  EXPECT_NE(said.find("gflow: warning: cannot lock the folder ("), said.npos) << said;
}
