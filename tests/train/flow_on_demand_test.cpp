// SPDX-License-Identifier: Apache-2.0
// The source of computed flow does not affect training.
#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class FlowOnDemand : public testing::Test {
 protected:
  FlowOnDemand() : queue(test_queue()), scene(queue), config(small_config(scene, 40)) {
    config.flow.source = FlowSource::dis;
  }
  // The model's bits, and the number of stored flows whose names contain `word`.
  std::pair<std::string, size_t> train(const std::string& name, const std::string& store,
                                       const std::string& word = "") {
    const std::string run = folder.path() + "/" + name;
    const std::string settings = folder.write("config.toml", to_toml(config));
    const Outcome outcome = gflow({"train", scene.path(), "-o", run, "--config", settings,
                                   "--quiet", "--overwrite", "--set", "flow.store=" + store});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    size_t flows = 0;
    for (const auto& entry : fs::directory_iterator(run + "/flow"))
      flows += entry.is_regular_file() &&
               entry.path().filename().string().find(word) != std::string::npos;
    const RunFolder made(run);
    return {contents(made.model_path(made.models().at(0))), flows};
  }

  Queue queue;
  SmallScene scene;
  TrainOptions config;
  TemporaryFolder folder;
};

TEST_F(FlowOnDemand, ATrainingIsTheSameWithFlowComputedBeforehandOrWhenNeededKeptOrNot) {
  const auto [expected, all] = train("beforehand", "1");
  EXPECT_EQ(all, 24u);  // three cameras, four pairs of steps, both directions
  const auto [unkept, none] = train("unkept", "0");
  EXPECT_EQ(none, 0u);
  EXPECT_TRUE(unkept == expected);
  const std::string some_room = "1e-5";  // 10.7 kB: less than a byte per pixel of all
  const auto [cold, some] = train("kept", some_room);
  EXPECT_GT(some, 0u);
  EXPECT_LT(some, all);
  EXPECT_TRUE(cold == expected);
  EXPECT_TRUE(train("kept", some_room).first == expected);  // from the store
}

TEST_F(FlowOnDemand, ATrainingIsTheSameWithChainsKeptOrNot) {
  config.flow.span = 4;
  const auto [expected, kept] = train("kept", "1", "_chained");
  EXPECT_GT(kept, 5u);  // of 24: three cameras, four pairs over 2 and 4 frames, both directions
  const auto [unkept, none] = train("unkept", "0", "_chained");
  EXPECT_EQ(none, 0u);
  EXPECT_TRUE(unkept == expected);
  EXPECT_TRUE(train("kept", "1").first == expected);  // from the store
}

}  // namespace
}  // namespace gflow
