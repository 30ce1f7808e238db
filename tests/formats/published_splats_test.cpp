// SPDX-License-Identifier: Apache-2.0
// Round trips of models from other programs, if these exist beside the repository. The synthetic
// files of splat_formats_test.cpp and ply_test.cpp have the same layouts and are always tested.
#include <algorithm>
#include <filesystem>

#include "optim/formats/dot_splat.hpp"
#include "optim/formats/splat_table.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr const char* not_shipped =
    "models of other people, megabytes under their own licences, are not shipped with gflow; made "
    "files of the same layouts are tested in their place. Missing: ";

// Name and number of Gaussians.
class PublishedSplats : public testing::TestWithParam<std::pair<const char*, size_t>> {
 protected:
  void SetUp() override {
    path_ = std::string(GFLOW_SOURCE_DIR) + "/../shared/data/splat_models/" + GetParam().first;
    if (!std::filesystem::exists(path_)) GTEST_SKIP() << not_shipped << path_;
    table_ = standard_table(read_splats(path_), path_).table;
  }

  const TemporaryFolder folder_;
  std::string path_;
  PlyTable table_;
};
INSTANTIATE_TEST_SUITE_P(
    Io, PublishedSplats,
    testing::Values(std::pair("biker.compressed.ply", size_t{152746}),
                    std::pair("guitar.compressed.ply", size_t{90854}),
                    std::pair("kacytran_iter7000.ply", size_t{9080}),
                    std::pair("splat_transform_fixtures/minimal-v2.spz", size_t{4}),
                    std::pair("splat_transform_fixtures/minimal-v3.spz", size_t{4}),
                    std::pair("splat_transform_fixtures/minimal-v4.spz", size_t{4}),
                    std::pair("splat_transform_fixtures/minimal.splat", size_t{4})));

TEST_P(PublishedSplats, ComeBackFromAPlyBitByBit) {
  ASSERT_EQ(table_.rows, GetParam().second);
  const std::string file = folder_.file("again.ply");
  write_ply(file, table_);
  const PlyTable again = read_splats(file);
  EXPECT_EQ(again.names, table_.names);
  EXPECT_TRUE(again.values == table_.values);
}

// Colours and opacities are bytes, and colours end at 0 and 1; positions and scales are floats. The
// file is sorted, so sums are compared instead of Gaussians.
TEST_P(PublishedSplats, ComeBackFromASplatUpToItsBytes) {
  const std::string file = folder_.file("again.splat");
  write_dot_splat(file, table_);
  const PlyTable again = read_splats(file);
  ASSERT_EQ(again.rows, table_.rows);
  for (const char* column : {"x", "y", "z"}) {
    std::vector<float> before = table_.column_values(column), after = again.column_values(column);
    std::sort(before.begin(), before.end());
    std::sort(after.begin(), after.end());
    EXPECT_TRUE(before == after) << column;
  }
  const auto mean_opacity = [](const PlyTable& table) {
    double sum = 0;
    for (const float logit : table.column_values("opacity")) sum += opacity_of_logit(double(logit));
    return sum / double(table.rows);
  };
  EXPECT_NEAR(mean_opacity(again), mean_opacity(table_), 0.5 / 255);
}

// Two versions of the same Gaussians.
TEST(PublishedSpz, Versions3And4AreEqual) {
  const std::string folder =
      std::string(GFLOW_SOURCE_DIR) + "/../shared/data/splat_models/splat_transform_fixtures/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << not_shipped << folder;
  EXPECT_EQ(read_splats(folder + "minimal-v4.spz").values,
            read_splats(folder + "minimal-v3.spz").values);
}

}  // namespace
}  // namespace gflow
