// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/reader_util.hpp"

#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

TEST(ReaderUtil, AFrameHasTheNearestStepOrTheEarlierOfTwo) {
  const std::vector<double> times = {0, 0.25, 0.5, 1};
  const std::vector<std::pair<double, int>> expected = {
      {0, 0}, {0.1, 0}, {0.125, 0}, {0.13, 1}, {0.25, 1}, {0.5, 2}, {0.75, 2}, {0.9, 3}, {1, 3}};
  std::vector<Frame> frames;
  for (const auto& [time, step] : expected) frames.emplace_back().time = time;
  for (const double outside : {-1., 2.}) frames.emplace_back().time = outside;
  set_steps(times, frames);
  for (size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(frames[i].step, expected[i].second) << expected[i].first;
  EXPECT_EQ(frames[expected.size()].step, 0);
  EXPECT_EQ(frames.back().step, 3);
}

TEST(ReaderUtil, PointsOf4dgaussiansAreFoundByTheirNames) {
  for (const char* name : {"points3D_multipleview.ply", "points3D_downsample2.ply"}) {
    const TemporaryFolder folder;
    write_point_cloud(folder.file(name), {{1, 2, 3}, {}});
    std::vector<std::string> notices;
    EXPECT_EQ(find_points(folder.path(), notices).size(), 1u) << name;
    EXPECT_TRUE(notices.empty());
    write_point_cloud(folder.file("points3D.ply"), {{1, 2, 3, 4, 5, 6}, {}});
    EXPECT_EQ(find_points(folder.path(), notices).size(), 2u) << name;
  }
}

TEST(ReaderUtil, APointCloudOfAnotherNameIsReportedOnce) {
  const TemporaryFolder folder;
  std::vector<std::string> notices;
  folder.write("a_damaged.ply", "ply");
  folder.write("b_without_points.ply",
               "ply\nformat ascii 1.0\nelement vertex 1\nproperty float s\nend_header\n0\n");
  EXPECT_EQ(find_points(folder.path(), notices).size(), 0u);
  EXPECT_TRUE(notices.empty());
  for (const char* name : {"scan.ply", "scan_2.PLY"})
    write_point_cloud(folder.file(name), {{1, 2, 3}, {}});
  EXPECT_EQ(find_points(folder.path(), notices).size(), 0u);
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("scan.ply are not used: rename it to points3D.ply"), std::string::npos);
}

}  // namespace
}  // namespace gflow
