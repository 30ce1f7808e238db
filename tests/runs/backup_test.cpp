// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/backup.hpp"

#include <filesystem>

#include "optim/runs/run_names.hpp"
#include "optim/runs/staging.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// A run to be replaced.
class BackupTest : public testing::Test {
 protected:
  BackupTest() : run_(folder_.path()) {
    for (const std::string& name : names_) folder_.write(name, "former");
    folder_.write("notes.txt", "of a user");
  }

  void expect_all_there() const {
    for (const std::string& name : names_)
      EXPECT_EQ(contents(folder_.path() + "/" + name), "former") << name;
    EXPECT_FALSE(fs::exists(run_.path(temporary_folder_name(Backup::kName))));
    EXPECT_FALSE(fs::exists(run_.path("point_cloud/" + temporary_folder_name(Backup::kName))));
  }
  // The folder as left by a process killed while replacing, before or after the next training has
  // started.
  void kill_in_replacing(bool begun) const {
    const std::string pid = "1";  // not a running gflow
    std::vector<std::string> all = run_.training(), results = run_.results();
    all.insert(all.end(), results.begin(), results.end());
    for (const std::string& path : all) {
      const fs::path from(path), aside = from.parent_path() / (".former." + pid + "-0.part");
      fs::create_directory(aside);
      fs::rename(from, aside / from.filename());
    }
    // The file that is renamed first.
    if (!begun) folder_.write(".next." + pid + "-0.part/config.toml", "next");
    folder_.write(".next." + pid + "-0.part/cameras.json", "next");
  }
  void expect_none_there() const {
    for (const std::string& name : names_)
      EXPECT_EQ(fs::exists(folder_.path() + "/" + name), name == "config.toml") << name;
    EXPECT_TRUE(fs::exists(folder_.path() + "/notes.txt"));
  }

  const std::vector<std::string> names_{"training.json",
                                        "checkpoints/iteration_5.npz",
                                        "point_cloud/iteration_5/point_cloud.ply",
                                        "metrics.jsonl",
                                        "input.ply",
                                        "results.json",
                                        "test/a.png",
                                        "config.toml"};
  TemporaryFolder folder_;
  RunFolder run_;
};

TEST_F(BackupTest, ComeBackUnlessTheyAreGivenUp) {
  {
    Backup former(run_);
    former.put_aside(run_.training());
    former.put_aside(run_.results());
    expect_none_there();
  }
  expect_all_there();
  {
    Backup former(run_);
    former.put_aside(run_.training());
    former.put_aside(run_.results());
    former.give_up();
  }
  expect_none_there();
  EXPECT_TRUE(run_.training().empty());
  EXPECT_TRUE(run_.results().empty());
  EXPECT_EQ(folder_.count(), 2u);  // notes and settings
}

TEST_F(BackupTest, ComeBackWhereOneOfThemCannotGo) {
  // An unrelated folder has the same name.
  const std::string models = run_.path("point_cloud/" + temporary_folder_name(Backup::kName));
  folder_.write("point_cloud/" + fs::path(models).filename().string() + "/iteration_5/x", "");
  {
    Backup former(run_);
    expect_error([&] { former.put_aside(run_.training()); },
                 {"cannot write", "point_cloud/iteration_5: "});
    EXPECT_FALSE(fs::exists(run_.path("training.json")));
  }
  EXPECT_TRUE(fs::exists(run_.path("training.json")));
  EXPECT_TRUE(fs::exists(run_.path("checkpoints/iteration_5.npz")));
}

// As on a full disk: the next process that opens the folder restores them.
TEST_F(BackupTest, ThatCannotComeBackAreNotLost) {
  {
    const StagedFiles next(run_);
    folder_.write(fs::path(next.folder().folder()).filename().string() + "/config.toml", "next");
    Backup former(run_);
    former.put_aside(run_.training());
    former.put_aside(run_.results());
    EXPECT_TRUE(Backup::are_aside(run_));
    // Obstacles.
    for (const char* name : {"point_cloud/iteration_5/x", "test/b.png", "input.ply/x"})
      folder_.write(name, "");
    testing::internal::CaptureStderr();
  }
  const std::string told = testing::internal::GetCapturedStderr();
  EXPECT_NE(told.find("cannot put back " + run_.path("test") + ": "), std::string::npos) << told;
  EXPECT_NE(told.find(", nor 2 more; the next gflow"), std::string::npos) << told;
  EXPECT_TRUE(Backup::are_aside(run_));
  restore_backup(run_);
  EXPECT_FALSE(fs::exists(run_.path("test/b.png")));
  EXPECT_FALSE(fs::exists(run_.path("point_cloud/iteration_5/x")));
  run_.forget_unfinished_files();
  expect_all_there();
  EXPECT_FALSE(fs::exists(run_.path(temporary_folder_name(StagedFiles::kName))));
}

// Symbolic links to another disk, which must stay.
TEST_F(BackupTest, MayLieBehindLinks) {
  const TemporaryFolder scratch;
  fs::rename(run_.path("checkpoints"), scratch.path() + "/kept");
  fs::rename(run_.path("point_cloud/iteration_5"), scratch.path() + "/kept/iteration_5");
  fs::remove(run_.path("point_cloud"));
  fs::rename(run_.path("test"), scratch.path() + "/drawn");
  scratch.write(std::string("drawn/") + kOnlyOurs, "");
  fs::create_directory_symlink(scratch.path() + "/drawn", run_.path("test"));
  for (const char* link : {"checkpoints", "point_cloud"})
    fs::create_directory_symlink(scratch.path() + "/kept", run_.path(link));
  for (const bool given_up : {false, true}) {
    expect_all_there();
    Backup former(run_);
    former.put_aside(run_.training());
    former.put_aside(run_.results());
    EXPECT_EQ(scratch.count(), 4u) << "not moved to another disk";
    if (given_up) former.give_up();
  }
  for (const char* link : {"checkpoints", "point_cloud", "test"})
    EXPECT_TRUE(fs::is_symlink(run_.path(link)));
  EXPECT_EQ(scratch.count(), 1u);
}

// A process is killed before or after the next training has written its settings.
TEST_F(BackupTest, ComeBackWhereTheNextTrainingHadNotBegun) {
  for (const bool begun : {false, true}) {
    kill_in_replacing(begun);
    restore_backup(run_);
    run_.forget_unfinished_files();
    if (begun)
      expect_none_there();
    else
      expect_all_there();
    EXPECT_FALSE(fs::exists(run_.path(".former.1-0.part")));
    EXPECT_FALSE(fs::exists(run_.path(".next.1-0.part")));
  }
}

TEST_F(BackupTest, ComeBackBeforeARunIsOpened) {
  kill_in_replacing(false);
  folder_.write("results.json", "of what was left, as by an older gflow");
  EXPECT_EQ(RunFolder::open(folder_.path()).models(), std::vector<int>{5});
  expect_all_there();
  EXPECT_EQ(folder_.count(), names_.size() + 2) << "nothing but these, notes and .lock";
}

// The owner of the lock must restore them: it may be about to start.
TEST_F(BackupTest, ComeBackUnderTheLockAlone) {
  kill_in_replacing(false);
  {
    const FileLock lock = run_.lock();
    restore_backup(run_);
    EXPECT_TRUE(run_.training().empty());
    restore_backup(run_, lock);
  }
  expect_all_there();
}

}  // namespace
}  // namespace gflow
