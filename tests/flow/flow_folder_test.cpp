// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/flow_folder.hpp"

#include <filesystem>

#include "tests/support/file_size_limit.hpp"
#include "tests/support/moving_texture.hpp"

using namespace gflow;
namespace fs = std::filesystem;

namespace {

Bytes some_flow(float u) { return packed({uniform(8, 8, u, 0), std::vector<uint8_t>(64, 255)}); }

class FlowFolderTest : public testing::Test {
 protected:
  FlowFolder with_room_for(double flows) {
    return FlowFolder(path, uint64_t(flows * double(some_flow(1).size())),
                      [this](const std::string& sentence) { notices.push_back(sentence); });
  }
  std::string file(const std::string& name) const { return path + "/" + name + ".flow"; }
  // Sets the time explicitly: the system's own times are too coarse to order uses.
  void used(const std::string& name, int minutes_ago) const {
    fs::last_write_time(file(name),
                        fs::file_time_type::clock::now() - std::chrono::minutes(minutes_ago));
  }

  TemporaryFolder folder;
  std::string path = folder.path() + "/flow";
  std::vector<std::string> notices;
};

}  // namespace

TEST_F(FlowFolderTest, GivesBackWhatItKeeps) {
  FlowFolder flows = with_room_for(10);
  EXPECT_FALSE(flows.has("a", 8, 8));
  EXPECT_FALSE(flows.read("a", 8, 8));
  flows.keep("a", some_flow(3));
  EXPECT_TRUE(flows.has("a", 8, 8));
  EXPECT_FALSE(flows.has("a", 8, 9));
  EXPECT_FALSE(flows.read("a", 8, 9));
  EXPECT_EQ(flows.read("a", 8, 8)->flow.uv[0], 3);
  EXPECT_TRUE(notices.empty());
}

TEST_F(FlowFolderTest, DropsWhatWasUnusedForLongest) {
  FlowFolder flows = with_room_for(3.5);
  for (const char* name : {"a", "b", "c"}) flows.keep(name, some_flow(1));
  used("a", 30);
  used("b", 20);
  used("c", 10);
  flows.read("a", 8, 8);
  flows.keep("d", some_flow(1));
  EXPECT_TRUE(flows.has("a", 8, 8));
  EXPECT_FALSE(flows.has("b", 8, 8));
  EXPECT_TRUE(flows.has("c", 8, 8));
  EXPECT_TRUE(flows.has("d", 8, 8));
  flows.keep("d", some_flow(2));  // replaces itself
  EXPECT_TRUE(flows.has("c", 8, 8));
}

TEST_F(FlowFolderTest, CountsWhatOthersKeptThere) {
  FlowFolder wide = with_room_for(10), narrow = with_room_for(2.5);
  for (const char* name : {"a", "b", "c", "d"}) wide.keep(name, some_flow(1));
  for (int i = 0; i < 4; ++i) used(std::string(1, char('a' + i)), 40 - i);
  narrow.keep("e", some_flow(1));
  size_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(path)) bytes += entry.file_size();
  EXPECT_LE(bytes, 2.5 * double(some_flow(1).size()));
  EXPECT_TRUE(narrow.has("d", 8, 8) && narrow.has("e", 8, 8));
}

TEST_F(FlowFolderTest, WithoutRoomNothingIsKept) {
  FlowFolder flows = with_room_for(0.5);
  flows.keep("a", some_flow(1));
  EXPECT_TRUE(fs::is_empty(path));
}

TEST_F(FlowFolderTest, ADamagedFlowIsNoFlowAndIsNamed) {
  FlowFolder flows = with_room_for(10);
  flows.keep("a", some_flow(1));
  Bytes bytes = read_file(file("a"));
  bytes.back() ^= 1;
  write_file_atomically(file("a"), bytes);
  EXPECT_TRUE(flows.has("a", 8, 8));  // checks length and header
  EXPECT_FALSE(flows.read("a", 8, 8));
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("a.flow is damaged"), std::string::npos) << notices[0];
}

TEST_F(FlowFolderTest, AFullDiskIsAnErrorAndLeavesNothing) {
  FlowFolder flows = with_room_for(10);
  const FileSizeLimit limit(10);
  expect_error([&] { flows.keep("a", some_flow(1)); }, {"a.flow"});
  EXPECT_TRUE(fs::is_empty(path));
}
