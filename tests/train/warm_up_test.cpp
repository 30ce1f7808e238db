// SPDX-License-Identifier: Apache-2.0
// The kernel warm-up compiles the kernels of a training step and no others. Running it in another
// process changes only the time when training starts.
#include "optim/train/warm_up.hpp"

#include <sched.h>

#include <optional>
#include <set>

#include "runtime/files/file_lock.hpp"
#include "tests/support/command_scene.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/on_one_scene.hpp"

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

// Kernels of scanning, sorting, binning (on CPUs and GPUs), selection of tiles and density control:
// compiled quickly, so left to the training.
bool is_left_out(const std::string& kernel) {
  const std::set<std::string> some = {
      "seen_count", "seen_write",     "tile_count",      "tile_columns", "tile_scatter",
      "tile_ids",   "tile_pairs",     "tile_starts",     "cell_mask",    "tiles_in_order",
      "flow_tiles", "canonical_rows", "tiles_with_flow", "reduce_count", "adc_accumulate"};
  const bool of_rows = kernel.rfind("rows_", 0) == 0 || kernel.rfind("scan_", 0) == 0 ||
                       kernel.rfind("sort_", 0) == 0;
  return of_rows || some.count(kernel) > 0;
}

class WarmUp : public OnOneScene, public testing::WithParamInterface<MotionModelKind> {};

TEST_P(WarmUp, CompilesWhatAStepNeedsAndNothingBesides) {
  for (const bool flow : {true, false}) {
    TrainOptions config = small_config(scene(), 10);
    config.motion.model = choice_of(GetParam());
    config.flow.enabled = flow;
    Queue warming_up = profiling_queue(), training = profiling_queue();
    warm_up_kernels(warming_up, config);
    SmallTraining steps(training, config);
    steps.steps(training, 4);
    steps.trainer.report(training);

    const std::set<std::string> warmed_up = kernels_of(warming_up), used = kernels_of(training);
    EXPECT_GT(warmed_up.size(), 14u);
    for (const std::string& kernel : used)
      EXPECT_TRUE(warmed_up.count(kernel) || is_left_out(kernel)) << kernel;
    for (const std::string& kernel : warmed_up) EXPECT_TRUE(used.count(kernel)) << kernel;
    for (const auto& [program, handle] : warming_up.programs)
      EXPECT_TRUE(training.programs.count(program)) << program.substr(0, program.find('\n'));
  }
}

INSTANTIATE_TEST_SUITE_P(Models, WarmUp,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& info) { return std::string(name_of(info.param)); });

class CompilingAhead : public OnOneScene {
 protected:
  void SetUp() override {
    cpu_set_t usable;  // hardware_concurrency() would count cores that taskset forbids
    ASSERT_EQ(sched_getaffinity(0, sizeof usable, &usable), 0);
    if (!is_pocl(queue().info) || CPU_COUNT(&usable) < 2)
      GTEST_SKIP() << "the device is not PoCL's, or there is one core alone: nothing is to be had";
    fs::create_directory(cache());
    environment_.emplace("POCL_CACHE_DIR", cache());
  }
  void TearDown() override { environment_.reset(); }
  std::string path(const std::string& name) const { return folder_.path() + "/" + name; }
  std::string cache() const { return path("cache"); }
  std::vector<std::string> train(const std::string& run, const std::string& iterations = "1") {
    // Half as much to compile without flow and test views.
    return {"train",   scene().path(),    "-o",
            path(run), "--iterations",    iterations,
            "--quiet", "--set",           "flow.enabled=false",
            "--set",   "scene.holdout=-1"};
  }
  // Finished warm-ups.
  size_t marks() const {
    size_t count = 0;
    for (const auto& entry : fs::directory_iterator(cache()))
      count += entry.path().filename().string().rfind("gflow-", 0) == 0;
    return count;
  }
  // Whether a second process has used PoCL's folder, since the last call for was_begun_since().
  bool was_begun() const { return fs::exists(lock()); }
  bool was_begun_since() const { return fs::remove(lock()); }
  std::string lock() const { return cache() + "/gflow.lock"; }
  // Starts a training and stops it, so that only its second process finishes. The training is long:
  // a training of one step may end on a busy machine before the second process, which has lower
  // priority, starts.
  void warm_up_alone(const std::vector<std::string>& more = {}) {
    const size_t before = marks();
    std::vector<std::string> arguments = train("stopped", "100000");
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Command command(arguments);
    EXPECT_TRUE(wait_until([&] { return was_begun(); }));
    command.send(SIGSTOP);
    EXPECT_TRUE(wait_until([&] { return marks() == before + 1; }));
    command.send(SIGKILL);
    command.wait();
    EXPECT_TRUE(was_begun_since());
  }
  std::string model(const std::string& run) const {
    return contents(path(run) + "/point_cloud/iteration_1/point_cloud.ply");
  }

 private:
  TemporaryFolder folder_;
  std::optional<Environment> environment_;
};

TEST_F(CompilingAhead, HappensOnceAndChangesNoBit) {
  EXPECT_EQ(gflow(train("first")).code, 0);
  EXPECT_TRUE(was_begun_since());
  if (marks() == 0) warm_up_alone();  // the training finished first
  EXPECT_EQ(gflow(train("second")).code, 0);
  EXPECT_FALSE(was_begun_since());
  EXPECT_EQ(marks(), 1u);
  fs::remove_all(cache());
  fs::create_directory(cache());
  const Environment alone("GFLOW_COMPILE_AHEAD", "0");
  EXPECT_EQ(gflow(train("third")).code, 0);
  EXPECT_FALSE(was_begun());
  EXPECT_FALSE(model("first").empty());
  EXPECT_TRUE(model("first") == model("second"));
  EXPECT_TRUE(model("first") == model("third"));
}

TEST_F(CompilingAhead, IsDoneAgainForSettingsThatAreCompiled) {
  warm_up_alone();
  warm_up_alone({"--set", "skip.boxes=false"});
}

// The second process ends with the first, however that ends, and leaves no mark of completion.
TEST_F(CompilingAhead, EndsWithTheTraining) {
  for (const int signal : {SIGTERM, SIGKILL}) {
    const Command command(train("run"));
    ASSERT_TRUE(wait_until([&] { return was_begun(); }));
    command.send(signal);
    EXPECT_EQ(command.wait().code, 128 + signal);
    // It held the lock; the process has exited when the lock is free.
    EXPECT_TRUE(wait_until([&] {
      try {
        const FileLock free(cache() + "/gflow.lock", "the lock");
        return true;
      } catch (const FileIsLocked&) {
        return false;
      }
    }));
    EXPECT_EQ(marks(), 0u);
    fs::remove(cache() + "/gflow.lock");
  }
}

TEST_F(CompilingAhead, IsNothingForOneCore) {
  const Outcome outcome = gflow(train("run"), "taskset -p -c 0 $$ > /dev/null");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_FALSE(was_begun());
}

TEST_F(CompilingAhead, IsSwitchedBy0Or1) {
  const Environment wrong("GFLOW_COMPILE_AHEAD", "no");
  const Outcome outcome = gflow(train("run"));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("GFLOW_COMPILE_AHEAD is 'no'; it must be 1 or 0"), std::string::npos)
      << outcome.err;
}

}  // namespace
}  // namespace gflow
