// SPDX-License-Identifier: Apache-2.0
#include "optim/io/unfinished_file.hpp"

#include <atomic>
#include <chrono>
#include <csignal>
#include <list>
#include <thread>

#include "io/temporary_folder.hpp"
#include "optim/io/atomic_file.hpp"

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

// By another thread, which had named it.
TEST(UnfinishedFile, ThatIsMadeAMomentLaterIsRemovedToo) {
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
          const UnfinishedFile none(folder.path() + "/none");  // no other is begun
          folder.write("none", "");
        });
        while (!named) std::this_thread::yield();
        remove_unfinished_files();
        _exit(3);
      },
      testing::ExitedWithCode(3), "");
  EXPECT_EQ(folder.count(), 0u);
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
