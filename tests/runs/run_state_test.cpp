// SPDX-License-Identifier: Apache-2.0
// Selection of the shown state of a run, which needs neither a device nor a lock.
#include "optim/runs/run_state.hpp"

#include <atomic>
#include <filesystem>
#include <thread>

#include "optim/motion/parameters_state.hpp"
#include "tests/support/lively_model.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// The contents of a model's checkpoint; the first `moving` Gaussians are dynamic.
Arrays state_of(Queue& queue, Model& model, size_t moving) {
  const Parameters& all = model.parameters;
  Parameters some(queue, all.count, all.specs, all.more_specs, moving);
  const auto from = all.tables();
  const auto to = some.tables();
  for (size_t t = 0; t < to.size(); ++t)
    for (size_t g = 0; g < to[t]->groups.size(); ++g) {
      std::vector<float> values = from[t]->groups[g].values.read(queue);
      values.resize(to[t]->groups[g].values.size());
      to[t]->groups[g].values.write(queue, values);
    }
  model.parameters = std::move(some);
  Arrays arrays;
  save_state(queue, model.parameters, arrays);
  return arrays;
}

class StateOfCheckpoint : public testing::TestWithParam<MotionModelKind> {};

TEST_P(StateOfCheckpoint, IsTheModelThatTheDeviceHolds) {
  Queue queue = test_queue();
  for (const size_t moving : {size_t{60}, size_t{25}, size_t{0}}) {
    const HostModel lively = lively_model(GetParam());
    Model model(queue, lively);
    const Arrays arrays = state_of(queue, model, moving);
    const HostModel read = model_of_state(model.shape, arrays, "a file");
    EXPECT_EQ(read.count, 60u);
    EXPECT_TRUE(read.groups == model.read(queue).groups) << moving;
    EXPECT_EQ(read.groups == lively.groups, moving == 60 || !model.parameters.has_motion_rows());
    Arrays less = arrays;
    less.erase("gaussians/quats");
    expect_error([&] { model_of_state(model.shape, less, "a file"); }, {"a file", "quats"});
    Arrays more = arrays;
    more["gaussians/moving"] = {{1}, std::vector<uint32_t>{4000000000u}};
    expect_error([&] { model_of_state(model.shape, more, "a file"); },
                 {"a file", "4000000000 of 60"});
    expect_error([&] { load_state(queue, model.parameters, more, "a file"); },
                 {"a file", "4000000000 of 60"});
  }
}

INSTANTIATE_TEST_SUITE_P(Models, StateOfCheckpoint,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& info) { return name_of(info.param); });

// A run of 3000 steps with the files that a test adds.
class RunStateTest : public testing::Test {
 protected:
  RunStateTest() : run(folder.path()), lively(lively_model(MotionModelKind::spacetime)) {
    Queue queue = test_queue();
    Model model(queue, lively);
    checkpoint.arrays = state_of(queue, model, lively.count);
    config.train.iterations = 3000;
    checkpoint.facts.seconds = 12.5;
    checkpoint.facts.config = to_toml(config);
    checkpoint.facts.device = "a device";
    run.write_config(config);
    write_model(run.path("input.ply"), lively);
  }
  void write_checkpoint_of(int step) {
    checkpoint.facts.step = step;
    run.checkpoints().write(checkpoint);
  }
  void write_point_cloud_of(int iteration) const {
    folder.file("point_cloud/iteration_" + std::to_string(iteration) + "/x");
    write_model(run.model_path(iteration), lively);
  }

  TemporaryFolder folder;
  RunFolder run;
  HostModel lively;
  TrainOptions config;
  Checkpoint checkpoint;
};

TEST_F(RunStateTest, IsTheNewestOfPointCloudsAndCheckpoints) {
  write_checkpoint_of(1200);
  const RunState early = read_run_state(run);
  EXPECT_EQ(early.text(), "iteration 1200 of 3000, from the checkpoint");
  EXPECT_EQ(early.facts.iterations, 1200);
  EXPECT_EQ(early.facts.train_seconds, 12.5);
  EXPECT_EQ(early.facts.device, "a device");
  EXPECT_EQ(early.facts.motion, "spacetime");
  EXPECT_TRUE(early.model.groups == lively.groups);
  write_point_cloud_of(1100);
  EXPECT_EQ(read_run_state(run).iteration, 1200);
  write_point_cloud_of(1200);
  EXPECT_EQ(read_run_state(run).text(), "iteration 1200 of 3000, from its point cloud");
  write_point_cloud_of(1300);
  EXPECT_EQ(read_run_state(run).iteration, 1300);
  EXPECT_TRUE(std::isnan(read_run_state(run).facts.train_seconds));
  run.write_facts({1300, 20, 300, "another", "spacetime"});
  EXPECT_EQ(read_run_state(run).facts.train_seconds, 20);
}

TEST_F(RunStateTest, OfAnIterationIsOneThatThereIs) {
  write_checkpoint_of(1200);
  write_point_cloud_of(700);
  EXPECT_EQ(read_run_state(run, 700).text(), "iteration 700 of 3000, from its point cloud");
  EXPECT_TRUE(read_run_state(run, 1200).checkpoint);
  expect_error([&] { read_run_state(run, 800); }, {"iteration 800", "700, 1200"});
}

TEST_F(RunStateTest, OfACheckpointNeedsTheFirstGaussiansOnlyWhereItIsOfAnOlderGflow) {
  write_checkpoint_of(1200);
  fs::remove(run.path("input.ply"));
  expect_error([&] { read_run_state(run); }, {"iteration_1200.npz", "older", "input.ply"});
  checkpoint.facts.shape = lively.shape;
  write_checkpoint_of(1300);
  EXPECT_TRUE(read_run_state(run).model.groups == lively.groups);
}

TEST_F(RunStateTest, SaysWhenThereIsNone) {
  expect_error([&] { read_run_state(run); }, {folder.path(), "no model yet"});
}

TEST_F(RunStateTest, IsTheOneBeforeADamagedOne) {
  write_checkpoint_of(1000);
  write_checkpoint_of(1200);
  fs::resize_file(run.checkpoints().path(1200), 1000);
  testing::internal::CaptureStderr();
  EXPECT_EQ(read_run_state(run).iteration, 1000);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said.rfind("gflow: warning: ", 0), 0u) << said;
  EXPECT_NE(said.find("iteration_1200.npz"), std::string::npos) << said;
  expect_error([&] { read_run_state(run, 1200); }, {"iteration_1200.npz"});
}

// Two checkpoints are kept, but new ones come so fast that those a reader has listed are often gone
// when it opens them.
TEST_F(RunStateTest, IsReadWhileATrainingReplacesIt) {
  write_checkpoint_of(1);
  std::atomic<bool> enough{false};
  std::thread trainer([&] {
    for (int step = 2; !enough; ++step) write_checkpoint_of(step);
  });
  int last = 0;
  testing::internal::CaptureStderr();
  for (int i = 0; i < 200; ++i) {
    const RunState state = read_run_state(run);
    EXPECT_GE(state.iteration, last);
    EXPECT_TRUE(state.model.groups == lively.groups);
    last = state.iteration;
  }
  enough = true;
  trainer.join();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_GT(last, 1);
}

TEST_F(RunStateTest, SettingsComeFromTheCheckpointWhereTheirFileIsGoneOrDamaged) {
  const std::string file = run.path("config.toml"), whole = contents(file);
  write_checkpoint_of(1200);
  const auto read = [&] {
    testing::internal::CaptureStderr();
    const TrainOptions config = RunFolder::open(folder.path()).read_config();
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(to_toml(config), whole);
    return said;
  };
  EXPECT_EQ(read(), "");
  folder.write("config.toml", whole.substr(0, whole.find("iterations") + 6));
  EXPECT_NE(read().find("iteration_1200.npz"), std::string::npos);
  folder.write("config.toml", whole.substr(0, whole.find("[train]")));  // truncated, but valid TOML
  EXPECT_EQ(read(), "");
  fs::remove(file);
  EXPECT_NE(read().find("config.toml"), std::string::npos);
  fs::remove_all(run.path("checkpoints"));
  expect_error([&] { RunFolder::open(folder.path()); }, {"config.toml"});
}

}  // namespace
}  // namespace gflow
