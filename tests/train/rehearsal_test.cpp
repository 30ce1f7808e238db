// SPDX-License-Identifier: Apache-2.0
// The rehearsal has compiled what a training step needs, and nothing else; and the process that it
// runs in changes nothing of the training but when it begins.
#include "optim/train/rehearsal.hpp"

#include <set>

#include "environment.hpp"
#include "train/command_scene.hpp"
#include "train/on_one_scene.hpp"

namespace gflow {
namespace {

Queue profiling_queue() {
  QueueOptions options;
  options.profile = true;
  return Queue(find_device(), options);
}

std::set<std::string> kernels_of(Queue& queue) {
  std::set<std::string> names;
  for (const auto& [name, timing] : queue.timings()) names.insert(name);
  return names;
}

// Of scanning, sorting, binning and density control: short ones, left to the training.
bool is_left_out(const std::string& kernel) {
  const std::set<std::string> some = {"seen_count",   "seen_write",    "tile_count", "tile_columns",
                                      "tile_scatter", "cell_mask",     "flow_tiles", "still_rows",
                                      "reduce_count", "adc_accumulate"};
  const bool of_rows = kernel.rfind("rows_", 0) == 0 || kernel.rfind("scan_", 0) == 0 ||
                       kernel.rfind("sort_", 0) == 0;
  return of_rows || some.count(kernel) > 0;
}

class Rehearsal : public OnOneScene, public testing::WithParamInterface<MotionModelKind> {};

TEST_P(Rehearsal, CompilesWhatAStepNeedsAndNoProgramBesides) {
  TrainConfig config = small_config(scene(), 10);
  config.motion.model = choice_of(GetParam());
  Queue rehearsing = profiling_queue(), training = profiling_queue();
  rehearse(rehearsing, config);
  SmallTraining steps(training, config);
  steps.steps(training, 4);
  steps.trainer.figures(training);

  const std::set<std::string> rehearsed = kernels_of(rehearsing);
  size_t needed = 0;
  for (const std::string& kernel : kernels_of(training)) {
    if (is_left_out(kernel)) continue;
    ++needed;
    EXPECT_TRUE(rehearsed.count(kernel)) << kernel;
  }
  EXPECT_GT(needed, 14u);
  for (const auto& [program, handle] : rehearsing.programs)
    EXPECT_TRUE(training.programs.count(program)) << program.substr(0, program.find('\n'));
}

INSTANTIATE_TEST_SUITE_P(Models, Rehearsal,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane),
                         [](const auto& info) { return std::string(name_of(info.param)); });

class CompilingAhead : public OnOneScene {
 protected:
  bool has_pocl() { return is_pocl(queue().info); }
  // Of one training step.
  Outcome train(const std::string& run) {
    return gflow({"train", scene().path(), "-o", run, "--iterations", "1", "--quiet", "--set",
                  "scene.test_every=0"});
  }
};

// Files that say that kernels are compiled.
size_t marks_in(const std::string& folder) {
  size_t count = 0;
  for (const auto& entry : fs::directory_iterator(folder))
    count += entry.path().filename().string().rfind("gflow-", 0) == 0;
  return count;
}

std::string model_in(const std::string& run) {
  return contents(run + "/point_cloud/iteration_1/point_cloud.ply");
}

TEST_F(CompilingAhead, HappensOnceAndChangesNoBit) {
  if (!has_pocl() || std::thread::hardware_concurrency() < 2)
    GTEST_SKIP() << "the device is not PoCL's, or there is one core alone: nothing is to be gained";
  const TemporaryFolder folder;
  const std::string cache = folder.path() + "/cache", other = folder.path() + "/other";
  fs::create_directory(cache);
  fs::create_directory(other);
  const std::string first = folder.path() + "/first", second = folder.path() + "/second";
  {
    const Environment programs("POCL_CACHE_DIR", cache);
    EXPECT_EQ(train(first).code, 0);
    EXPECT_EQ(marks_in(cache), 1u);
    EXPECT_EQ(train(second).code, 0);
    EXPECT_EQ(marks_in(cache), 1u);
  }
  const Environment programs("POCL_CACHE_DIR", other);
  const Environment alone("GFLOW_COMPILE_AHEAD", "0");
  const std::string third = folder.path() + "/third";
  EXPECT_EQ(train(third).code, 0);
  EXPECT_EQ(marks_in(other), 0u);
  EXPECT_FALSE(model_in(first).empty());
  EXPECT_TRUE(model_in(first) == model_in(second));
  EXPECT_TRUE(model_in(first) == model_in(third));
}

// What it left undone the next training may do.
TEST_F(CompilingAhead, EndsWithTheTrainingAndLeavesNoMarkThen) {
  if (!has_pocl() || std::thread::hardware_concurrency() < 2)
    GTEST_SKIP() << "the device is not PoCL's, or there is one core alone: nothing is to be gained";
  const TemporaryFolder folder;
  const std::string cache = folder.path() + "/cache";
  fs::create_directory(cache);
  const Environment programs("POCL_CACHE_DIR", cache);
  const Outcome outcome =
      gflow({"train", folder.path() + "/nowhere", "-o", folder.path() + "/run", "--quiet"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(marks_in(cache), 0u);
}

TEST_F(CompilingAhead, IsSwitchedBy0Or1) {
  const TemporaryFolder folder;
  const Environment wrong("GFLOW_COMPILE_AHEAD", "no");
  const Outcome outcome = train(folder.path() + "/run");
  EXPECT_NE(outcome.err.find("GFLOW_COMPILE_AHEAD is 'no'; it must be 1 or 0"), std::string::npos)
      << outcome.err;
}

}  // namespace
}  // namespace gflow
