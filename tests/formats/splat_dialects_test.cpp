// SPDX-License-Identifier: Apache-2.0
// Files as other programs write them, made of known Gaussians by the descriptions of their columns.
#include "optim/formats/splat_dialects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "optim/formats/splat_table.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// Three Gaussians with the values of a trained file: log scales below 0 and logits of both signs.
PlyTable trained_table() {
  SplatTable splats(3, 0, Normals::none);
  for (size_t i = 0; i < 3; ++i) {
    const SplatRow row = splats.row(i);
    for (size_t k = 0; k < 3; ++k) {
      row.mean[k] = float(i) + 0.25f * float(k);
      row.sh0[k] = 0.5f * float(k) - 0.3f * float(i);
      row.log_scales[k] = -1 - float(i) - 0.5f * float(k);
    }
    *row.logit_opacity = 1 - float(i);
    row.quat[0] = 1;
  }
  return splats.table;
}

void drop_column(PlyTable& table, const std::string& name) {
  const size_t columns = table.names.size(), gone = size_t(table.column(name));
  std::vector<float> kept;
  for (size_t at = 0; at < table.values.size(); ++at)
    if (at % columns != gone) kept.push_back(table.values[at]);
  table.values = kept;
  table.names.erase(table.names.begin() + long(gone));
}

void add_column(PlyTable& table, const std::string& name, const std::vector<float>& column) {
  const size_t columns = table.names.size();
  std::vector<float> wider;
  for (size_t i = 0; i < table.rows; ++i) {
    const auto row = table.values.begin() + long(i * columns);
    wider.insert(wider.end(), row, row + long(columns));
    wider.push_back(column[i]);
  }
  table.values = wider;
  table.names.push_back(name);
}

std::string written(const TemporaryFolder& folder, const std::string& name, const PlyTable& table) {
  write_ply(folder.file(name), table);
  return folder.file(name);
}

std::string warnings_of(const std::function<void()>& f) {
  testing::internal::CaptureStderr();
  f();
  return testing::internal::GetCapturedStderr();
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != text.npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in: " << text;
}

TEST(SplatDialects, AStandardFileIsReadAsItIsWithoutAWarning) {
  const TemporaryFolder folder;
  const PlyTable table = trained_table();
  const std::string path = written(folder, "a.ply", table);
  PlyTable read;
  EXPECT_EQ(warnings_of([&] { read = read_splats(path); }), "");
  EXPECT_EQ(read.values, table.values);
  EXPECT_EQ(read.names, table.names);
}

// In any case and with any blanks; the last comment on it counts.
TEST(SplatDialects, CommentsTellOfAntialiasing) {
  const std::vector<std::vector<std::string>> yes = {
      {"SplatRenderMode: mip"},
      {"  SPLATRENDERMODE:  MIP "},
      {"antialiased 1"},
      {"SplatRenderMode: default", "by hand", "antialiased 1"}};
  const std::vector<std::vector<std::string>> no = {{},
                                                    {"SplatRenderMode: default"},
                                                    {"antialiased 0"},
                                                    {"antialiased"},
                                                    {"not antialiased 1"},
                                                    {"antialiased 1", "SplatRenderMode: default"}};
  for (const auto& comments : yes) EXPECT_TRUE(is_antialiased(comments)) << comments[0];
  for (const auto& comments : no) EXPECT_FALSE(is_antialiased(comments)) << comments.size();
}

TEST(SplatDialects, GaussiansOfTwoScalesAreFlat) {
  const TemporaryFolder folder;
  const PlyTable solid = trained_table();
  PlyTable flat = solid;
  drop_column(flat, "scale_2");
  const std::string path = written(folder, "a.ply", flat);
  PlyTable read;
  EXPECT_TRUE(
      contains(warnings_of([&] { read = read_splats(path); }), path + ": it has no scale_2"));
  EXPECT_EQ(read.column_values("scale_2"), std::vector<float>(3, log_of_scale(0)));
  for (const std::string& name : flat.names)
    EXPECT_EQ(read.column_values(name), solid.column_values(name)) << name;
}

TEST(SplatDialects, OtherMissingScalesAreAnError) {
  const TemporaryFolder folder;
  PlyTable table = trained_table();
  drop_column(table, "scale_1");
  expect_error([&] { read_splats(written(folder, "a.ply", table)); }, {"'scale_1' is missing"});
}

// Bytes as nerfstudio writes them, and reals of both usual ranges.
TEST(SplatDialects, ColoursBecomeHarmonics) {
  const TemporaryFolder folder;
  const auto file = [&](const std::string& type, const std::string& rgb) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex 1\n";
    for (const char* name : {"x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
                             "rot_1", "rot_2", "rot_3"})
      text += fmt::format("property float {}\n", name);
    for (const char* name : {"red", "green", "blue"})
      text += "property " + type + " " + name + "\n";
    return folder.write("a.ply", text + "end_header\n1 2 3 0.5 -2 -2 -2 1 0 0 0 " + rgb + "\n");
  };
  const auto colors = [&](const std::string& type, const std::string& rgb) {
    SplatTable table = standard_table(read_splats(file(type, rgb)), "a.ply");
    const float* sh0 = table.row(0).sh0;
    std::vector<int> levels;
    for (size_t k = 0; k < 3; ++k) levels.push_back(int(std::lround(255 * color_of_sh0(sh0[k]))));
    return levels;
  };
  EXPECT_EQ(colors("uchar", "255 0 51"), (std::vector<int>{255, 0, 51}));
  EXPECT_EQ(colors("uchar", "1 0 1"), (std::vector<int>{1, 0, 1}));
  EXPECT_EQ(colors("float", "1 0 0.2"), (std::vector<int>{255, 0, 51}));
  EXPECT_EQ(colors("float", "255 0 51"), (std::vector<int>{255, 0, 51}));
}

TEST(SplatDialects, HarmonicsArePreferredToColours) {
  const TemporaryFolder folder;
  PlyTable table = trained_table();
  for (const char* name : {"red", "green", "blue"}) add_column(table, name, {0.5f, 0.5f, 0.5f});
  const PlyTable read = read_splats(written(folder, "a.ply", table));
  EXPECT_EQ(read.column_values("f_dc_1"), table.column_values("f_dc_1"));
}

// Scales 3, 4, 5 and a filter of 12, 3, 0 in turn: 3^2 + 12^2 = 153 and so on.
TEST(SplatDialects, TheFilterOfMipSplattingIsAppliedOnce) {
  const TemporaryFolder folder;
  PlyTable table = trained_table();
  const std::vector<double> scales{3, 4, 5}, filters{12, 3, 0};
  for (size_t i = 0; i < 3; ++i)
    for (size_t k = 0; k < 3; ++k)
      table.values[i * table.names.size() + size_t(table.column("scale_0")) + k] =
          float(std::log(scales[k]));
  add_column(table, "filter_3D", {12, 3, 0});
  const std::string path = written(folder, "a.ply", table);
  SplatTable once(0, 0);
  EXPECT_TRUE(contains(warnings_of([&] { once = standard_table(read_splats(path), path); }),
                       path + ": its 3D filter"));
  const std::vector<float> logits = table.column_values("opacity");
  for (size_t i = 0; i < 3; ++i) {
    double ratio = 1;
    for (size_t k = 0; k < 3; ++k) {
      const double scale = std::hypot(scales[k], filters[i]);
      EXPECT_NEAR(std::exp(once.row(i).log_scales[k]), scale, 1e-5 * scale);
      ratio *= scales[k] / scale;
    }
    EXPECT_NEAR(opacity_of_logit(*once.row(i).logit_opacity), opacity_of_logit(logits[i]) * ratio,
                1e-6);
  }
  write_ply(folder.file("b.ply"), once.table);
  EXPECT_EQ(standard_table(read_splats(folder.file("b.ply")), "b.ply").table.values,
            once.table.values);
}

TEST(SplatDialects, AFilterMakesFlatGaussiansSolidAndUnseen) {
  const TemporaryFolder folder;
  PlyTable table = trained_table();
  drop_column(table, "scale_2");
  add_column(table, "filter_3D", {0.5f, 0, std::nanf("")});
  const PlyTable read = read_splats(written(folder, "a.ply", table));
  ASSERT_EQ(read.rows, 2u);  // without the filter that is NaN
  EXPECT_NEAR(std::exp(read.column_values("scale_2")[0]), 0.5, 1e-6);
  EXPECT_LE(opacity_of_logit(read.column_values("opacity")[0]), 1.1e-6);
  EXPECT_EQ(read.column_values("scale_2")[1], log_of_scale(0));
  EXPECT_EQ(read.column_values("opacity")[1], table.column_values("opacity")[1]);
}

// The scales and opacities of a trained file without their logarithms and logits.
TEST(SplatDialects, LengthsInPlaceOfLogarithmsAreDoubted) {
  const TemporaryFolder folder;
  PlyTable table = trained_table();
  const size_t columns = table.names.size();
  for (size_t i = 0; i < table.rows; ++i) {
    float* row = table.values.data() + i * columns;
    for (const char* name : {"scale_0", "scale_1", "scale_2"})
      row[table.column(name)] = std::exp(row[table.column(name)]);
    row[table.column("opacity")] = float(i) / 2;
  }
  const std::string path = written(folder, "a.ply", table);
  PlyTable read;
  EXPECT_TRUE(contains(warnings_of([&] { read = read_splats(path); }),
                       path + ": all its scales are positive"));
  EXPECT_EQ(read.values, table.values);
  const auto is_silent = [&](const std::string& name, const PlyTable& other) {
    return warnings_of([&] { read_splats(written(folder, name, other)); }).empty();
  };
  PlyTable small = table, seen = table, own = table, one = table;
  small.values[columns + size_t(table.column("scale_1"))] = -0.1f;
  seen.values[columns + size_t(table.column("opacity"))] = 1.1f;
  own.comments = {"gflow spacetime"};
  one.rows = 1;
  one.values.resize(columns);
  EXPECT_TRUE(is_silent("small.ply", small));
  EXPECT_TRUE(is_silent("seen.ply", seen));
  EXPECT_TRUE(is_silent("own.ply", own));
  EXPECT_TRUE(is_silent("one.ply", one));
}

TEST(SplatDialects, TheRestPoseOfADeformationNetworkIsNamed) {
  const TemporaryFolder folder;
  const PlyTable table = trained_table();
  const std::string alone = written(folder, "a/point_cloud/iteration_7/point_cloud.ply", table);
  EXPECT_EQ(warnings_of([&] { read_splats(alone); }), "");
  folder.write("b/point_cloud/iteration_7/deformation.pth", "PK");
  folder.write("c/deform/iteration_7/deform.pth", "PK");
  for (const char* run : {"b", "c"}) {
    const std::string path =
        written(folder, std::string(run) + "/point_cloud/iteration_7/point_cloud.ply", table);
    EXPECT_TRUE(contains(warnings_of([&] { read_splats(path); }),
                         path + ": it has the rest pose of the deformation network"));
  }
}

// A file of the lite model: trained_table() with colours for harmonics, and motion.
PlyTable spacetime_gaussians() {
  PlyTable table = trained_table();
  add_column(table, "trbf_center", {0.25f, 0.5f, 0.75f});
  add_column(table, "trbf_scale", {-2, 0, 1});
  for (int k = 0; k < 9; ++k)
    add_column(table, fmt::format("motion_{}", k), {0.1f * float(k), 0, -0.3f});
  for (int k = 0; k < 4; ++k) add_column(table, fmt::format("omega_{}", k), {0, 0.1f, 0.2f});
  return table;
}

TEST(SplatDialects, SpacetimeGaussiansMoveByTheSpacetimeModel) {
  const TemporaryFolder folder;
  const PlyTable table = spacetime_gaussians();
  const std::string path = written(folder, "a.ply", table);
  PlyTable read;
  EXPECT_TRUE(contains(warnings_of([&] { read = read_splats(path); }),
                       path + ": the cubic term of its paths (motion_6 to motion_8) is left out"));
  for (const char* same : {"x", "opacity", "scale_1", "rot_0", "motion_0", "motion_5", "omega_3"})
    EXPECT_EQ(read.column_values(same), table.column_values(same)) << same;
  EXPECT_EQ(read.column_values("t"), table.column_values("trbf_center"));
  for (size_t i = 0; i < 3; ++i) {
    const double b = std::exp(table.column_values("trbf_scale")[i]), tau = 0.4;
    const double s = std::exp(read.column_values("scale_t")[i]);
    EXPECT_NEAR(std::exp(-tau * tau / (2 * s * s)), std::exp(-tau * tau / (b * b)), 1e-6);
    EXPECT_NEAR(color_of_sh0(read.column_values("f_dc_2")[i]), table.column_values("f_dc_2")[i],
                1e-6);
  }
  PlyTable square = table;
  for (const char* name : {"motion_6", "motion_7", "motion_8"}) drop_column(square, name);
  const std::string quiet = written(folder, "b.ply", square);
  EXPECT_EQ(warnings_of([&] { read_splats(quiet); }), "");
}

TEST(SplatDialects, ColoursOfANetworkAreRefused) {
  const TemporaryFolder folder;
  for (const char* feature : {"f_dc_3", "f_t_0"}) {
    PlyTable table = spacetime_gaussians();
    add_column(table, feature, {0, 0, 0});
    expect_error([&] { read_splats(written(folder, "a.ply", table)); },
                 {"a.ply", "full model of SpacetimeGaussians", "lite model"});
  }
}

TEST(SplatDialects, APointCloudIsNamedAsOne) {
  const TemporaryFolder folder;
  const std::string plain =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\n";
  const std::string colored =
      plain + "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const std::string& bytes :
       {plain + "end_header\n1 2 3\n", colored + "end_header\n1 2 3 4 5 6\n"})
    expect_error([&] { read_splats(folder.write("a.ply", bytes)); },
                 {"cannot read", "a.ply", "a point cloud", "points3D.ply"});
}

}  // namespace
}  // namespace gflow
