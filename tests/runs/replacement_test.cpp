// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/replacement.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <filesystem>

#include "optim/runs/run_names.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// A run to be replaced.
class Replacement : public testing::Test {
 protected:
  Replacement() : run_(folder_.path()) {
    for (const std::string& name : names_) folder_.write(name, "previous");
    folder_.write("notes.txt", "of a user");
    folder_.write("point_cloud/notes.txt", "of a user");
  }

  void begin() const {
    begin_run(run_, [&](const RunFolder& files) {
      for (const char* name : {"config.toml", "cameras.json", "input.ply"})
        std::ofstream(files.path(name)) << "next";
    });
  }
  // The folder as left by a process that was killed right after the run began, having removed or
  // renamed the first `done` files.
  void kill_during_replacement(int done) const {
    for (const char* name : {"config.toml", "cameras.json", "input.ply"})
      folder_.write(std::string(kRunBegun) + "/" + name, "next");
    const std::vector<std::string> removed{"training.json",
                                           "checkpoints/iteration_5.npz",
                                           "point_cloud/iteration_5",
                                           "metrics.jsonl",
                                           "input.ply",
                                           "test",
                                           "results.json"};
    for (int k = 0; k < std::min(done, int(removed.size())); ++k)
      fs::remove_all(run_.path(removed[size_t(k)]));
    const char* renamed[] = {"config.toml", "input.ply", "cameras.json"};
    for (int k = 0; k < done - int(removed.size()); ++k)
      fs::rename(run_.path(std::string(kRunBegun) + "/" + renamed[k]), run_.path(renamed[k]));
  }
  void expect_previous() const {
    for (const std::string& name : names_) EXPECT_EQ(contents(run_.path(name)), "previous") << name;
    EXPECT_EQ(folder_.count() - fs::exists(run_.path(kRunLock)), names_.size() + 2);
  }
  void expect_next() const {
    for (const char* name : {"config.toml", "cameras.json", "input.ply"})
      EXPECT_EQ(contents(run_.path(name)), "next") << name;
    for (const char* name : {"notes.txt", "point_cloud/notes.txt"})
      EXPECT_TRUE(fs::exists(run_.path(name))) << name;
    EXPECT_EQ(folder_.count() - fs::exists(run_.path(kRunLock)), 5u);
    EXPECT_FALSE(is_replacement_pending(run_));
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

TEST_F(Replacement, LeavesNothingOfThePreviousRunAndAllThatIsNotOfARun) {
  begin();
  expect_next();
}

TEST_F(Replacement, ChangesNothingIfTheNewFilesCannotBeWritten) {
  expect_error([&] { begin_run(run_, [](const RunFolder&) { throw Error("no space"); }); },
               {"no space"});
  expect_previous();
}

TEST_F(Replacement, ChangesNothingIfANewFileCannotTakeItsName) {
  fs::create_directory(run_.path("cameras.json"));
  expect_error([&] { begin(); }, {"cameras.json"});
  expect_previous();
}

// At every point after the rename that decides.
TEST_F(Replacement, IsCompletedByWhoeverOpensTheRunAfterAKill) {
  for (int done = 0; done <= 10; ++done) {
    for (const std::string& name : names_) folder_.write(name, "previous");
    kill_during_replacement(done);
    RunFolder::open(folder_.path());
    expect_next();
    fs::remove(run_.path("cameras.json"));
  }
}

// A run that was killed while it began in a new folder.
TEST_F(Replacement, MayHaveNothingToReplace) {
  const TemporaryFolder folder;
  const RunFolder run(folder.path());
  folder.write(std::string(kRunBegun) + "/config.toml", "next");
  EXPECT_TRUE(RunFolder::is_run(folder.path()));
  EXPECT_NO_THROW(RunFolder::create(folder.path()));
  RunFolder::open(folder.path());
  EXPECT_EQ(contents(run.path("config.toml")), "next");
}

// The owner of the lock completes it: it may be doing so now.
TEST_F(Replacement, IsCompletedUnderTheLockOnly) {
  kill_during_replacement(0);
  {
    const FileLock lock = run_.lock();
    complete_replacement(run_);
    EXPECT_TRUE(is_replacement_pending(run_));
    EXPECT_EQ(contents(run_.path("training.json")), "previous");
    complete_replacement(run_, lock);
  }
  expect_next();
}

// Links to another disk stay if they lead to folders that training does not empty.
TEST_F(Replacement, FollowsLinksToModelsAndCheckpoints) {
  const TemporaryFolder scratch;
  for (const char* name : {"checkpoints", "point_cloud"}) {
    fs::rename(run_.path(name), scratch.path() + "/" + name);
    fs::create_directory_symlink(scratch.path() + "/" + name, run_.path(name));
  }
  begin();
  for (const char* name : {"checkpoints", "point_cloud"})
    EXPECT_TRUE(fs::is_symlink(run_.path(name))) << name;
  EXPECT_EQ(scratch.count(), 1u) << "the user's notes";
}

// The run may come from an untrusted source.
TEST_F(Replacement, RemovesALinkToAFolderOfImagesAndNotTheFolder) {
  const TemporaryFolder documents;
  documents.write("thesis.txt", "");
  fs::remove_all(run_.path("test"));
  fs::create_directory_symlink(documents.path(), run_.path("test"));
  begin();
  EXPECT_EQ(documents.count(), 1u);
  expect_next();
}

}  // namespace
}  // namespace gflow
