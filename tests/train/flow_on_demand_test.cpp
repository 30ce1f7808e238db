// SPDX-License-Identifier: Apache-2.0
// Where computed flow comes from changes nothing of a training.
#include "train/command.hpp"
#include "train/small_scene.hpp"

namespace gflow {
namespace {

TEST(FlowOnDemand, ATrainingIsTheSameWithFlowComputedBeforehandOrWhenNeededKeptOrNot) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainConfig config = small_config(scene, 40);
  config.flow.source = FlowSource::dis;
  const TemporaryFolder folder;
  folder.write("config.toml", to_toml(config));
  // The model's bits, and how many flows lie on the disk afterwards.
  const auto train = [&](const std::string& name, const std::string& store) {
    const std::string run = folder.path() + "/" + name;
    const Outcome outcome =
        gflow({"train", scene.path(), "-o", run, "--config", folder.file("config.toml"), "--quiet",
               "--overwrite", "--set", "flow.store=" + store});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    size_t flows = 0;
    for (const auto& entry : fs::directory_iterator(run + "/flow"))
      flows += entry.is_regular_file();
    const RunFolder folder(run);
    return std::pair(contents(folder.model_path(folder.models().at(0))), flows);
  };
  const auto [expected, all] = train("beforehand", "1");
  EXPECT_EQ(all, 24u);  // three cameras, four pairs of steps, both ways
  const auto [unkept, none] = train("unkept", "0");
  EXPECT_EQ(none, 0u);
  EXPECT_TRUE(unkept == expected);
  const std::string some_room = "1e-5";  // 10.7 kB, less than the byte a pixel that all might need
  const auto [cold, some] = train("kept", some_room);
  EXPECT_GT(some, 0u);
  EXPECT_LT(some, all);
  EXPECT_TRUE(cold == expected);
  EXPECT_TRUE(train("kept", some_room).first == expected);  // from what was kept
}

TEST(FlowOnDemand, ATrainingIsTheSameWithChainsKeptOrNot) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainConfig config = small_config(scene, 40);
  config.flow.source = FlowSource::dis;
  config.flow.reach = 4;
  const TemporaryFolder folder;
  folder.write("config.toml", to_toml(config));
  // The model's bits, and how many chains lie on the disk afterwards.
  const auto train = [&](const std::string& name, const std::string& store) {
    const std::string run = folder.path() + "/" + name;
    const Outcome outcome =
        gflow({"train", scene.path(), "-o", run, "--config", folder.file("config.toml"), "--quiet",
               "--overwrite", "--set", "flow.store=" + store});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    size_t chains = 0;
    for (const auto& entry : fs::directory_iterator(run + "/flow"))
      chains += entry.path().string().find("_chained") != std::string::npos;
    const RunFolder made(run);
    return std::pair(contents(made.model_path(made.models().at(0))), chains);
  };
  const auto [expected, kept] = train("kept", "1");
  EXPECT_GT(kept, 5u);  // of 24: three cameras, four pairs over 2 and 4 pictures, both ways
  const auto [unkept, none] = train("unkept", "0");
  EXPECT_EQ(none, 0u);
  EXPECT_TRUE(unkept == expected);
  EXPECT_TRUE(train("kept", "1").first == expected);  // from what was kept
}

}  // namespace
}  // namespace gflow
