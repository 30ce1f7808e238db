// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_folder.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

TEST(RunFolder, IsMadeWithTheFoldersAboveIt) {
  const TemporaryFolder folder;
  RunFolder::create(folder.path() + "/a/b");
  EXPECT_TRUE(std::filesystem::is_directory(folder.path() + "/a/b"));
}

TEST(RunFolder, CannotLieBelowAFile) {
  const TemporaryFolder folder;
  folder.write("file", "");
  expect_error([&] { RunFolder::create(folder.path() + "/file/run"); }, {"file/run"});
}

TEST(RunFolder, IsNotMadeOfALinkToNothing) {
  const TemporaryFolder folder;
  const std::string link = folder.path() + "/link", nowhere = folder.path() + "/nowhere";
  std::filesystem::create_directory_symlink(nowhere, link);
  expect_error([&] { RunFolder::create(link); }, {link + ": it is a link to " + nowhere});
  std::filesystem::create_directory(nowhere);
  RunFolder::create(link);
}

TEST(RunFolder, IsNotMadeOfAFolderThatHoldsSomethingElse) {
  const TemporaryFolder folder;
  folder.write("scene/flow/mine", "true flow");
  expect_error([&] { RunFolder::create(folder.path() + "/scene"); }, {"/scene", "not empty"});
  EXPECT_TRUE(std::filesystem::exists(folder.file("scene/flow/mine")));
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  run.remove_stale_caches("a scene");
  run.write_config({});
  EXPECT_NO_THROW(RunFolder::create(folder.path() + "/run"));  // can be trained from the start
}

// The stamp of the caches was removed.
TEST(RunFolder, WithoutItsStampIsARunStill) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() + "/checkpoints");
  std::filesystem::create_directory(folder.path() + "/point_cloud");
  for (const char* name : {"config.toml", "cameras.json", "video.mp4"}) folder.write(name, "");
  // They may be a user's own files, for --config and --cameras.
  expect_error([&] { RunFolder::create(folder.path()); }, {"not empty"});
  for (const char* trained : {"/checkpoints/iteration_5.npz", "/point_cloud/iteration_5"}) {
    std::filesystem::create_directory(folder.path() + trained);
    EXPECT_NO_THROW(RunFolder::create(folder.path()));
    std::filesystem::remove(folder.path() + trained);
  }
}

TEST(RunFolder, OfATrainingKilledAtItsVeryStartIsUsedAgain) {
  const TemporaryFolder folder;
  folder.write(".lock", "123");
  folder.write(".caches.123-0.part.stamp", "reso");
  std::filesystem::create_directory(folder.path() + "/.next.123-0.part");
  folder.write(".next.123-0.part/config.toml", "");
  const RunFolder run = RunFolder::create(folder.path());
  run.forget_unfinished_files();
  EXPECT_EQ(folder.count(), 1u);
  folder.write(".profile", "of somebody");
  expect_error([&] { RunFolder::create(folder.path()); }, {"not empty"});
}

TEST(RunFolder, KnowsWhateverIsOfAnEarlierTraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  EXPECT_FALSE(run.would_remove(""));
  EXPECT_FALSE(run.would_remove(folder.path() + "/../other.ply"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/./point_cloud/a.ply"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/cameras.json"));
  for (const char* name :
       {"metrics.jsonl", "metrics.csv", "input.ply", "input.motion.npz", "training.json",
        "checkpoints/iteration_1.npz", "point_cloud/iteration_1/point_cloud.ply"})
    folder.write(name, "");
  folder.write("point_cloud/notes.txt", "of a user");
  const std::vector<std::string> all = run.training();
  EXPECT_EQ(all.size(), 7u);
  EXPECT_EQ(all[0], run.path("training.json"));
  for (const std::string& path : all) std::filesystem::remove_all(path);
  EXPECT_TRUE(run.training().empty());
  EXPECT_TRUE(std::filesystem::exists(run.path("point_cloud/notes.txt")));
}

// A disk that is not mounted, or a folder of another user.
TEST(RunFolder, IsNotTakenForEmptyWhereItsFoldersAreAway) {
  const TemporaryFolder folder;
  const RunFolder run(folder.path());
  EXPECT_NO_THROW(run.require_its_folders());
  std::filesystem::create_directory_symlink("/no/such/disk", run.path("checkpoints"));
  expect_error([&] { run.require_its_folders(); },
               {"checkpoints is a link to /no/such/disk, which does not exist"});
  std::filesystem::remove(run.path("checkpoints"));
  folder.write("point_cloud", "a file");
  expect_error([&] { run.require_its_folders(); }, {"cannot list", "point_cloud"});
  std::filesystem::remove(run.path("point_cloud"));
  for (const char* name : {"flow", "frames", "test"}) {
    std::filesystem::create_directory_symlink("/no/such/disk", run.path(name));
    expect_error([&] { run.require_its_folders(); },
                 {std::string(name) + " is a link to /no/such"});
    std::filesystem::remove(run.path(name));
  }
}

// The folder may come from an untrusted source.
TEST(RunFolder, ForgetsALinkToStaleCachesAndNotWhatItLeadsTo) {
  const TemporaryFolder folder, documents;
  const RunFolder run = RunFolder::create(folder.path());
  documents.write("thesis.txt", "");
  folder.write("frames/0.png", "");
  std::filesystem::create_directory_symlink(documents.path(), run.path("flow"));
  run.remove_stale_caches("a");
  EXPECT_FALSE(std::filesystem::is_symlink(run.path("flow")));
  EXPECT_FALSE(std::filesystem::exists(run.path("frames")));
  EXPECT_EQ(documents.count(), 1u);
}

TEST(RunFolder, HoldsATrainingWhereAnythingOfOneIsWorthKeeping) {
  for (const char* name : {"checkpoints/iteration_1.npz", "training.json", "results_train.json",
                           "point_cloud/iteration_1/point_cloud.ply", "test/a.png"}) {
    const TemporaryFolder folder;
    const RunFolder run = RunFolder::create(folder.path());
    for (const char* begun : {"config.toml", "input.ply", "metrics.jsonl"}) folder.write(begun, "");
    EXPECT_FALSE(run.holds_training());
    folder.write(name, "");
    EXPECT_TRUE(run.holds_training()) << name;
  }
}

// `gflow render` may be writing into its own folder there.
TEST(RunFolder, LeavesWhatOthersAreWriting) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  const pid_t other = ::fork();
  if (other == 0) {
    ::pause();
    ::_exit(0);
  }
  const std::string living = "checkpoints/.iteration_1." + std::to_string(other) + "-0.part.npz",
                    left = "checkpoints/.iteration_1.1-0.part.npz",
                    drawn = "images/rgb/.a.1-0.part.png";
  for (const std::string& name : {living, left, drawn}) folder.write(name, "");
  run.forget_unfinished_files();
  EXPECT_TRUE(std::filesystem::exists(run.path(living)));
  EXPECT_FALSE(std::filesystem::exists(run.path(left)));
  EXPECT_TRUE(std::filesystem::exists(run.path(drawn)));
  ::kill(other, SIGKILL);
  ::waitpid(other, nullptr, 0);
  run.forget_unfinished_files();
  EXPECT_FALSE(std::filesystem::exists(run.path(living)));
}

TEST(RunFolder, KnowsWhatItWouldForgetThroughLinks) {
  const TemporaryFolder folder, other;
  const RunFolder run(folder.path());
  EXPECT_FALSE(run.would_remove(folder.path()));
  EXPECT_FALSE(run.would_remove(folder.path() + "/images"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/test/"));
  std::filesystem::create_directory(folder.path() + "/frames");
  std::filesystem::create_directory_symlink(folder.path() + "/frames", other.path() + "/link");
  EXPECT_TRUE(run.would_remove(other.path() + "/link/cam01"));
  EXPECT_FALSE(run.would_remove(other.path() + "/images"));
  std::filesystem::create_directory_symlink(other.path(), folder.path() + "/flow");
  EXPECT_TRUE(run.would_remove(folder.path() + "/flow/images"));
}

TEST(RunFolder, KnowsTheResultsOfEverySplit) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const char* name : {"results.json", "results_train.json", "per_view_val.json",
                           "results_iteration_300.json", "per_view_val_iteration_300.json"})
    folder.write(name, "{}");
  folder.write("results_paper.json", "of a user");
  EXPECT_EQ(run.results().size(), folder.count() - 1);
  for (const std::string& path : run.results()) EXPECT_EQ(path.find("paper"), path.npos) << path;
}

TEST(RunFolder, IsOpenedOnlyWhereThereIsAConfiguration) {
  const TemporaryFolder folder;
  expect_error([&] { RunFolder::open(folder.path()); }, {folder.path(), "config.toml"});
  RunFolder::create(folder.path()).write_config({});
  EXPECT_NO_THROW(RunFolder::open(folder.path()));
}

TEST(RunFolder, IsNotOpenedWhileATrainingBeginsThere) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  {
    const FileLock lock = run.lock();
    expect_error([&] { RunFolder::open(run.folder()); },
                 {run.folder(), "being written by process"});
  }
  expect_error([&] { RunFolder::open(run.folder()); }, {run.folder(), "no config.toml"});
  EXPECT_NO_THROW(RunFolder::require_no_pending_replacement(run.folder()));
}

TEST(RunFolder, ConfigurationComesBack) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  TrainOptions config;
  config.flow.weight = 0.125f;
  config.scene.path = "a \"quoted\" path";
  run.write_config(config);
  EXPECT_EQ(to_toml(run.read_config()), to_toml(config));
}

// As after a full disk; an empty file would silently mean default settings.
TEST(RunFolder, AnEmptyConfigurationIsRefused) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  folder.write("config.toml", "");
  expect_error([&] { run.read_config(); }, {"config.toml", "is empty"});
}

TEST(RunFolder, ModelsAreInTheOrderOfTheirIterationsNotOfTheirNames) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const int iteration : {3, 900, 10000}) {
    const std::string path = run.model_path(iteration);
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    std::ofstream(path) << "ply";
  }
  std::filesystem::create_directories(run.path("point_cloud/iteration_20000"));  // without a model
  std::filesystem::create_directories(run.path("point_cloud/other"));
  EXPECT_EQ(run.models(), (std::vector<int>{10000, 900, 3}));
}

// Otherwise a copy would be read in place of the model that its number names.
TEST(RunFolder, CopiesUnderOtherNamesAreNoModels) {
  const TemporaryFolder folder;
  for (const char* name : {"iteration_61", "iteration_0061", "iteration_ 8", "iteration_-5",
                           "iteration_007", "iteration_+3", "iteration_61.old", "iteration_61 "})
    folder.write(std::string("point_cloud/") + name + "/point_cloud.ply", "ply");
  EXPECT_EQ(RunFolder(folder.path()).models(), std::vector<int>{61});
}

TEST(RunFolder, MayHaveNoModelYet) {
  const TemporaryFolder folder;
  EXPECT_TRUE(RunFolder::create(folder.path()).models().empty());
}

TEST(RunFolder, ForgetsModelsOfAnEarlierTraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const int iteration : {100, 200}) {
    std::filesystem::create_directories(
        std::filesystem::path(run.model_path(iteration)).parent_path());
    std::ofstream(run.model_path(iteration)) << "ply";
  }
  run.remove_model(200);
  run.remove_model(300);  // does not exist
  EXPECT_EQ(run.models(), std::vector<int>{100});
  EXPECT_EQ(folder.count(), 1u);
}

TEST(RunFolder, CachesMadeUnderAnotherStampAreForgotten) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.remove_stale_caches("one");
  for (const char* name : {"flow", "frames"}) std::filesystem::create_directories(run.path(name));
  run.remove_stale_caches("one");
  EXPECT_TRUE(std::filesystem::exists(run.path("flow")));
  run.remove_stale_caches("two");
  EXPECT_FALSE(std::filesystem::exists(run.path("flow")));
  EXPECT_FALSE(std::filesystem::exists(run.path("frames")));
}

}  // namespace
}  // namespace gflow
