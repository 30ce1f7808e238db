// SPDX-License-Identifier: Apache-2.0
// Files of the format's own program (tests/data/four_dgs) have the same contents for gflow.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "optim/formats/four_dgs.hpp"
#include "optim/formats/splat_table.hpp"
#include "shared/sh.h"

namespace gflow {
namespace {

std::string reference(const std::string& name) {
  return std::string(GFLOW_SOURCE_DIR) + "/tests/data/four_dgs/" + name;
}

double distance(const SplatRow& row, const nlohmann::json& splat) {
  double d = 0;
  for (size_t k = 0; k < 3; ++k)
    d = std::hypot(d, row.mean[k] - splat["position"][k].get<double>());
  return d;
}

// Both sides are floats near 1, computed differently; logits and logarithms lose a digit.
constexpr double kRounding = 2e-6, kThroughLogit = 2e-5;

void expect_same(const SplatRow& row, const nlohmann::json& splat) {
  const auto expected = [&](const char* name, size_t k) { return splat[name][k].get<double>(); };
  EXPECT_LT(distance(row, splat), 3 * kRounding);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(std::exp(row.log_scales[k]) / expected("scale", k), 1, kRounding);
    EXPECT_NEAR(color_of_sh0(row.sh0[k]), expected("rgb", k), kRounding);
  }
  for (size_t k = 0; k < 4; ++k)
    EXPECT_NEAR(row.quat[(k + 1) % 4], expected("rotation_xyzw", k), kRounding);
  EXPECT_NEAR(opacity_of_logit(*row.logit_opacity), splat["opacity"].get<double>(), kThroughLogit);
  for (size_t k = 0; k < splat["sh_rest"].size(); ++k)
    EXPECT_NEAR(row.sh_rest[k], expected("sh_rest", k), kRounding) << k;
}

void expect_as_its_reader_says(const std::string& name) {
  std::ifstream in(reference(name + ".json"));
  const auto values = nlohmann::json::parse(in);
  const MovingSplats scene = read_four_dgs(reference(name + ".4dgs"));
  EXPECT_EQ(scene.splats.size(), values["gaussians"].get<size_t>());
  EXPECT_EQ(scene.sh_degree, values["sh_degree"].get<int>());
  for (const auto& moment : values["at"]) {
    SCOPED_TRACE(fmt::format("{} at {}", name, moment["time"].dump()));
    const PlyTable found = splats_at(scene, moment["time"].get<double>());
    ASSERT_EQ(found.rows, moment["splats"].size());
    SplatTable table = standard_table(found, "test");
    for (const auto& splat : moment["splats"]) {
      size_t nearest = 0;
      for (size_t i = 1; i < found.rows; ++i)
        if (distance(table.row(i), splat) < distance(table.row(nearest), splat)) nearest = i;
      expect_same(table.row(nearest), splat);
    }
  }
}

TEST(FourDgsReference, WindowsLivesAndHighestValues) { expect_as_its_reader_says("two_windows"); }

TEST(FourDgsReference, NothingIsThereOutsideOfItsChunksInterval) {
  expect_as_its_reader_says("chunk_ends_first");
}

// Values: tests/conformance/data/OneGaussian-UseChunkIndex-UseCrc.json there.
TEST(FourDgsReference, TheSmallestConformanceFile) {
  const MovingSplats scene = read_four_dgs(reference("one_gaussian.4dgs"));
  EXPECT_EQ(scene.duration, 1);
  EXPECT_EQ(scene.cutoff, 0.05);
  ASSERT_EQ(scene.splats.size(), 1u);
  const MovingSplat& s = scene.splats[0];
  const auto expect_near = [](const auto& found, std::initializer_list<double> expected) {
    auto value = found.begin();
    for (const double e : expected) EXPECT_NEAR(*value++, e, 6e-7);  // the JSON has six digits
  };
  expect_near(s.mean, {-0.761085, -0.435832, -0.903013});
  expect_near(s.velocity, {0.031539, -0.079118, 0.063349});
  expect_near(s.scales, {0.002736, 0.002962, 0.001841});
  expect_near(s.quat, {0.02, 0.991468, 0.104, -0.076});
  expect_near(s.color, {0.023529, 0.972549, 0.847059});
  EXPECT_NEAR(s.opacity, 0.454902, 6e-7);
  EXPECT_NEAR(s.mean_t, 0.14, 6e-7);
  EXPECT_NEAR(s.life, 0.20511, 6e-7);
  EXPECT_EQ(s.begin, 0);
  EXPECT_EQ(s.end, 1);
}

}  // namespace
}  // namespace gflow
