// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/unfinished_file.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <list>
#include <optional>
#include <thread>

#include "runtime/files/atomic_file.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

TEST(UnfinishedFile, IsRemovedBySignalHandlersOnlyWhileItIsWritten) {
  const TemporaryFolder folder;
  const std::string done = folder.write("done", "1"), begun = folder.write("begun", "2");
  EXPECT_EXIT(
      {
        { const UnfinishedFile file(done); }
        const UnfinishedFile file(begun);
        remove_unfinished_files();
        _exit(3);
      },
      testing::ExitedWithCode(3), "");
  EXPECT_TRUE(std::filesystem::exists(done));
  EXPECT_FALSE(std::filesystem::exists(begun));
}

// Created by another thread that had already registered its name. On a busy machine that thread may
// not run within the moment that is waited for, so there are several tries.
TEST(UnfinishedFile, ThatIsMadeAMomentLaterIsRemovedToo) {
  size_t left = 1;
  for (int attempt = 0; attempt < 5 && left > 0; ++attempt) {
    const TemporaryFolder folder;
    const std::string late = folder.path() + "/late";
    EXPECT_EXIT(
        {
          std::atomic<bool> named{false};
          std::thread other([&] {
            const UnfinishedFile file(late);
            named = true;
            std::this_thread::sleep_for(std::chrono::milliseconds(4));
            folder.write("late", "");
            const UnfinishedFile none(folder.path() + "/none");  // no other file is started
            folder.write("none", "");
          });
          while (!named) std::this_thread::yield();
          remove_unfinished_files();
          usleep(20000);  // the program takes a while to end
          _exit(3);
        },
        testing::ExitedWithCode(3), "");
    left = folder.count();
  }
  EXPECT_EQ(left, 0u);
}

TEST(UnfinishedFile, OfAReplacedFileIsItsTemporary) {
  const TemporaryFolder folder;
  folder.write("a.txt", "before");
  EXPECT_EXIT(
      {
        std::signal(SIGTERM, [](int) {
          remove_unfinished_files();
          _exit(3);
        });
        replace_file(folder.file("a.txt"), [](const std::string&) { std::raise(SIGTERM); });
      },
      testing::ExitedWithCode(3), "");
  EXPECT_EQ(contents(folder.file("a.txt")), "before");
  EXPECT_EQ(folder.count(), 1u);
}

// Also between two system calls: a temporary once existed a moment before it was registered.
TEST(UnfinishedFile, NoneIsLeftWheneverASignalComes) {
  // In memory if possible: most of the time the process would otherwise wait for the disk.
  std::optional<Environment> memory;
  if (access("/dev/shm", W_OK) == 0) memory.emplace("TMPDIR", "/dev/shm");
  const TemporaryFolder folder;
  const std::string path = folder.file("a.txt");
  for (int trial = 0; trial < 200; ++trial) {
    std::filesystem::remove(path);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::signal(SIGTERM, [](int) {
        remove_unfinished_files();
        _exit(3);
      });
      for (;;) write_file_atomically(path, "whole");
    }
    while (!std::filesystem::exists(path)) usleep(10);
    usleep(useconds_t(trial * 7 % 500));
    kill(child, SIGTERM);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 3) << trial;
    ASSERT_EQ(folder.count(), 1u) << "trial " << trial;
    EXPECT_EQ(contents(path), "whole");
  }
}

TEST(UnfinishedFile, MoreThanThereIsRoomForAreWrittenAllTheSame) {
  const TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) {
    std::list<UnfinishedFile> many;
    for (int k = 0; k < 100; ++k) many.emplace_back(folder.file("none"));
  }
  const std::string begun = folder.write("begun", "");
  EXPECT_EXIT(
      {
        const UnfinishedFile file(begun);  // the slots are free again
        remove_unfinished_files();
        _exit(3);
      },
      testing::ExitedWithCode(3), "");
  EXPECT_FALSE(std::filesystem::exists(begun));
}
