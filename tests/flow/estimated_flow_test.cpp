// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/estimated_flow.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "tests/support/file_size_limit.hpp"
#include "tests/support/moving_texture.hpp"

using namespace gflow;
namespace fs = std::filesystem;

namespace {

constexpr size_t centre = 20 * 48 + 24;

class EstimatedFlow : public testing::Test {
 protected:
  EstimatedFlow() {
    how.folder = folder.path() + "/cache";
    how.threads = 2;
    how.progress = [this](size_t done, size_t) { steps.push_back(done); };
    how.notice = [this](const std::string& sentence) { notices.push_back(sentence); };
    for (const FlowPair& pair : reversed(pairs)) pairs.push_back(pair);
  }
  FlowStore estimate() { return estimated_flows(scene, pairs, frames, how); }
  std::string file(const std::string& name) const { return how.folder + "/" + name + ".flow"; }
  // All visible values of the flows.
  static std::vector<float> all_of(FlowStore& flows) {
    std::vector<float> all;
    for (size_t i = 0; i < flows.size(); ++i) {
      const auto target_flow = flows.get(i);
      all.insert(all.end(), target_flow->flow.uv.begin(), target_flow->flow.uv.end());
      all.insert(all.end(), target_flow->confidence.begin(), target_flow->confidence.end());
    }
    return all;
  }
  std::vector<float> all_flow() {
    FlowStore flows = estimate();
    return all_of(flows);
  }

  TemporaryFolder folder;
  Scene scene = textured_scene(folder, 5);
  std::vector<FlowPair> pairs = neighbour_pairs(scene);
  FrameStore frames{scene};
  FlowEstimation how;
  std::vector<size_t> steps;
  std::vector<std::string> notices;
};

}  // namespace

TEST_F(EstimatedFlow, ComesBothWaysForEachPairOfImages) {
  ASSERT_EQ(pairs.size(), 8u);
  EXPECT_TRUE(is_backward_in_time(scene, pairs[4]));
  FlowStore flows = estimate();
  EXPECT_EQ(steps, (std::vector<size_t>{1, 2, 3, 4}));
  EXPECT_TRUE(flows.is_precomputed());
  EXPECT_NEAR(flows.get(0)->flow.uv[2 * centre], 2, 0.2);
  EXPECT_NEAR(flows.get(4)->flow.uv[2 * centre], -2, 0.2);
  EXPECT_EQ(flows.get(0)->confidence[centre], 255);
  EXPECT_EQ(flows.get(4)->confidence[centre], 255);
}

TEST_F(EstimatedFlow, IsKeptAndUsedAgain) {
  estimate();
  // A marked file shows that it is read instead of computed again; a file of another size is
  // replaced.
  const TargetFlow marked{uniform(48, 40, 7, 7), std::vector<uint8_t>(48 * 40, 255)};
  const TargetFlow small{uniform(4, 4, 7, 7), std::vector<uint8_t>(16, 255)};
  write_file_atomically(file("input_0000"), packed(marked));
  write_file_atomically(file("input_0001"), packed(small));
  FlowStore again = estimate();
  EXPECT_EQ(again.get(0)->flow.uv[0], 7);
  EXPECT_NEAR(again.get(1)->flow.uv[2 * centre], 2, 0.2);
  EXPECT_TRUE(notices.empty());
}

TEST_F(EstimatedFlow, IsTheSameBeforehandAndWhenAskedForKeptOrNot) {
  const std::vector<float> expected = all_flow();
  how.beforehand = false;
  steps.clear();
  EXPECT_EQ(all_flow(), expected);  // from the disk
  how.folder += "_of_its_own";
  EXPECT_EQ(all_flow(), expected);  // computed; half of it was stored by an earlier computation
  how.folder += "_too";
  how.budget = 0;
  FlowStore flows = estimate();
  EXPECT_FALSE(flows.is_precomputed());
  EXPECT_TRUE(fs::is_empty(how.folder));
  flows.prefetch({7, 0, 3, 4, 1, 5, 6, 2});
  EXPECT_EQ(all_of(flows), expected);
  EXPECT_TRUE(fs::is_empty(how.folder));
  EXPECT_TRUE(steps.empty());
}

TEST_F(EstimatedFlow, ADamagedFileIsComputedAgainWithOneSentence) {
  const std::vector<float> expected = all_flow();
  const Bytes whole = read_file(file("input_0002"));
  Bytes damaged = whole;
  damaged[damaged.size() / 2] ^= 16;
  write_file_atomically(file("input_0002"), damaged);
  EXPECT_EQ(all_flow(), expected);
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("input_0002.flow is damaged"), std::string::npos) << notices[0];
  EXPECT_EQ(read_file(file("input_0002")), whole);
  EXPECT_EQ(all_flow(), expected);
  EXPECT_EQ(notices.size(), 1u);

  damaged = whole;
  damaged.resize(whole.size() - 3);  // detected and replaced without a message
  write_file_atomically(file("input_0002"), damaged);
  EXPECT_EQ(all_flow(), expected);
  EXPECT_EQ(read_file(file("input_0002")), whole);
}

TEST_F(EstimatedFlow, ADiskThatIsFullStopsNothingWhenItIsAskedFor) {
  const std::vector<float> expected = all_flow();
  how.folder += "_full";
  how.beforehand = false;
  const FileSizeLimit limit(50);
  EXPECT_EQ(all_flow(), expected);
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("recomputed when needed"), std::string::npos);
  how.beforehand = true;
  expect_error([&] { estimate(); }, {"input_000", ".flow"});
}

TEST_F(EstimatedFlow, TwoProcessesShareAFolderWithoutRoomForAll) {
  const std::vector<float> expected = all_flow();
  const uint64_t one = fs::file_size(file("input_0000"));
  how.folder += "_shared";
  how.beforehand = false;
  how.budget = 3 * one;
  std::vector<pid_t> children;
  for (int i = 0; i < 2; ++i) {
    children.push_back(fork());
    if (children.back() != 0) continue;
    FrameStore own(scene);
    bool same = true;
    for (int round = 0; round < 5; ++round) {
      FlowStore flows = estimated_flows(scene, pairs, own, how);
      flows.prefetch({1, 3, 5, 7});
      same = same && all_of(flows) == expected;
    }
    _exit(same && notices.empty() ? 0 : 1);
  }
  for (const pid_t child : children) {
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }
  // Each process stays within its budget; files that both write at the same moment may exceed it.
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(how.folder)) bytes += entry.file_size();
  EXPECT_LE(bytes, how.budget + 2 * one);
  EXPECT_GT(bytes, 0u);
}

TEST_F(EstimatedFlow, AnExceptionInProgressEndsTheWork) {
  how.progress = [](size_t, size_t) { throw Error("stop"); };
  EXPECT_THROW(estimate(), Error);
}
