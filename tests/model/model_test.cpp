// SPDX-License-Identifier: Apache-2.0
#include "optim/model/model.hpp"

#include <cstring>

#include "optim/eval/views.hpp"
#include "optim/formats/ply.hpp"
#include "optim/options/train_options.hpp"
#include "tests/support/device.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/random_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// A standard 3DGS PLY of two Gaussians with SH degree 1.
PlyTable static_table() {
  PlyTable table;
  table.rows = 2;
  table.names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int i = 0; i < 9; ++i) table.names.push_back("f_rest_" + std::to_string(i));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    table.names.push_back(name);
  for (size_t i = 0; i < 2 * table.names.size(); ++i)
    table.values.push_back(0.5f + 0.03f * float(i % 40));
  return table;
}

void set(PlyTable& table, size_t row, const std::string& name, float value) {
  table.values[row * table.names.size() + size_t(table.column(name))] = value;
}

void drop(PlyTable& table, const std::string& name) {
  PlyTable fewer;
  fewer.rows = table.rows;
  for (size_t i = 0; i < table.values.size(); ++i)
    if (table.names[i % table.names.size()] != name) fewer.values.push_back(table.values[i]);
  for (const std::string& n : table.names)
    if (n != name) fewer.names.push_back(n);
  table = fewer;
}

class EverySphericalHarmonicsDegree : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Model, EverySphericalHarmonicsDegree, testing::Values(0, 1, 2, 3));

TEST_P(EverySphericalHarmonicsDegree, ComesBackFromAFileBitByBit) {
  const TemporaryFolder folder;
  const HostModel model = random_model(5, GetParam());
  write_model(folder.file("model.ply"), model);
  const HostModel back = read_model(folder.file("model.ply"));
  EXPECT_EQ(back.count, 5u);
  EXPECT_EQ(back.shape.sh_degree, GetParam());
  EXPECT_EQ(back.shape.duration, 3.7f);
  EXPECT_EQ(back.shape.cutoff, 0.031f);
  EXPECT_EQ(back.groups, model.groups);
}

// The file with its header line "comment KEY ..." replaced or removed.
std::string with_comment(std::string bytes, const std::string& key, const std::string& instead) {
  const size_t at = bytes.find("comment " + key + " ");
  EXPECT_NE(at, std::string::npos) << key;
  const size_t end = bytes.find('\n', at) + 1;
  return bytes.replace(at, end - at, instead.empty() ? "" : "comment " + instead + "\n");
}

TEST(Model, OfAFileKeepsACutoffOfZero) {
  const TemporaryFolder folder;
  const std::string path = folder.file("model.ply");
  HostModel model = random_model(5, 0);
  model.shape.cutoff = 0;
  write_model(path, model);
  EXPECT_EQ(read_model(path).shape.cutoff, 0.f);
}

// The rows of the file (14 floats of 4 bytes) are freed before the groups that the file lacks (11
// of 26 floats) are created.
TEST(Model, OfAStillFileTakesNoMoreMemoryThanRowsAndModel) {
  constexpr size_t n = 500000;
  const float place_and_scale[6] = {0, 0, 3, 1, 1, 1};
  std::string row(32, char(200));
  std::memcpy(row.data(), place_and_scale, sizeof place_and_scale);
  std::string file;
  for (size_t i = 0; i < n; ++i) file += row;
  const TemporaryFolder folder;
  const std::string path = folder.write("still.splat", file);
  HostModel model;
  const double mib = memory_of([&] { model = read_model(path); });
  size_t floats = 0;
  for (const auto& [name, values] : model.groups) floats += values.size();
  EXPECT_EQ(model.count, n);
  EXPECT_LT(mib, double((floats + 7 * n) * sizeof(float)) / (1 << 20));
}

TEST(Model, RefusesDamagedCommentsOfItsOwnFiles) {
  const TemporaryFolder folder;
  const auto expect_damaged = [&](MotionModelKind kind, const std::string& key,
                                  const std::string& damaged, const char* why) {
    HostModel model = random_model(5, 0, kind);
    model.shape.origin = {6e6, 0, 1};
    write_model(folder.file("model.ply"), model);
    folder.write("model.ply", with_comment(contents(folder.file("model.ply")), key, damaged));
    SCOPED_TRACE(damaged.empty() ? "without " + key : damaged);
    expect_error([&] { read_model(folder.file("model.ply")); }, {"model.ply", "comment", why});
  };
  const auto spacetime = MotionModelKind::spacetime;
  for (const char* cutoff : {"cutoff x", "cutoff -", "cutoff 9", "cutoff -0.1", "cutoff nan"})
    expect_damaged(spacetime, "cutoff", cutoff, "at least 0, at most 0.5");
  for (const char* duration : {"duration -1", "duration 0", "duration nan", "duration 1e400",
                               "duration 1 s", "duration 1 2", "duration  "})
    expect_damaged(spacetime, "duration", duration, "above 0, at most 1e+30");
  expect_damaged(spacetime, "duration", "", "'duration' is missing");
  expect_damaged(spacetime, "gflow", "gflow spacetimes",
                 "'gflow spacetimes'; known models: spacetime");
  for (const char* origin : {"origin 1e400 0 0", "origin nan 0 0", "origin 1 2", "origin 1 2 3 4"})
    expect_damaged(spacetime, "origin", origin, "three numbers");
  expect_damaged(MotionModelKind::keyframes, "keys", "keys 2.5", "whole number above 0");
  expect_damaged(MotionModelKind::keyframes, "key_scales", "key_scales 2", "at most 1");
}

// Files of the first keyframe models had no comment key_scales.
TEST(Model, ReadsKeysWithoutTheirScales) {
  const TemporaryFolder folder;
  HostModel model = random_model(5, 0, MotionModelKind::keyframes);
  model.shape.key_scales = 0;
  write_model(folder.file("model.ply"), model);
  folder.write("model.ply", with_comment(contents(folder.file("model.ply")), "key_scales", ""));
  EXPECT_EQ(read_model(folder.file("model.ply")).shape.key_scales, 0);
}

// Older versions interpolated rows in time linearly and did not say so.
TEST(Model, FieldsOfOlderVersionsAreLinearInTime) {
  const TemporaryFolder folder;
  HostModel model = random_model(5, 0, MotionModelKind::hexplane);
  model.shape.hexplane.time_spline = 1;
  write_model(folder.file("model.ply"), model);
  EXPECT_EQ(read_model(folder.file("model.ply")).shape.hexplane.time_spline, 1);
  folder.write("model.ply", with_comment(contents(folder.file("model.ply")), "time_spline", ""));
  EXPECT_EQ(read_model(folder.file("model.ply")).shape.hexplane.time_spline, 0);
}

TEST(Model, TakesTheCommentsOfOthersForTheirOwnWords) {
  const TemporaryFolder folder;
  write_model(folder.file("model.ply"), random_model(5, 0));
  std::string bytes = contents(folder.file("model.ply"));
  bytes = with_comment(bytes, "gflow", "origin of this file: a camera");
  bytes = with_comment(bytes, "cutoff", "");
  folder.write("model.ply", with_comment(bytes, "duration", "duration of the film: a minute"));
  const ModelShape shape = read_model(folder.file("model.ply")).shape;
  EXPECT_EQ(shape.duration, ModelShape().duration);
  EXPECT_EQ(shape.cutoff, ModelShape().cutoff);
  EXPECT_EQ(shape.origin, ModelShape().origin);
}

TEST_P(EverySphericalHarmonicsDegree, ComesBackFromTheDeviceBitByBit) {
  Queue queue = test_queue();
  const HostModel model = random_model(5, GetParam());
  EXPECT_EQ(Model(queue, model).read(queue).groups, model.groups);
}

class EachMotionModel : public testing::TestWithParam<MotionModelKind> {};
INSTANTIATE_TEST_SUITE_P(Model, EachMotionModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& info) { return std::string(name_of(info.param)); });

TEST_P(EachMotionModel, ComesBackFromAFileAndFromTheDeviceBitByBit) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  const HostModel model = random_model(5, 1, GetParam());
  write_model(folder.file("model.ply"), model);
  const HostModel back = read_model(folder.file("model.ply"));
  EXPECT_EQ(back.shape.motion, GetParam());
  EXPECT_EQ(back.shape.keys, model.shape.keys);
  if (GetParam() == MotionModelKind::hexplane) {
    EXPECT_EQ(back.shape.hexplane.times, 3);
    EXPECT_EQ(back.shape.hexplane.centre, model.shape.hexplane.centre);
    EXPECT_EQ(back.shape.hexplane.half_size, model.shape.hexplane.half_size);
  }
  EXPECT_EQ(back.groups, model.groups);
  EXPECT_EQ(Model(queue, back).read(queue).groups, model.groups);
}

// Rows of a file may be in any order, and a Gaussian keeps its motion or rest with its row.
TEST_P(EachMotionModel, KeepsWhichGaussiansAreStatic) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  HostModel model = random_model(5, 1, GetParam());
  model.moving = 2;
  const HostModel rest = Model(queue, model).read(queue);  // without motion of their own
  EXPECT_EQ(rest.moving, 2u);
  for (const char* name : {"means", "quats", "sh_rest"})
    EXPECT_EQ(rest.groups.at(name), model.groups.at(name));
  for (const MotionColumns& columns : motion_columns(model.shape))
    EXPECT_NE(rest.groups.at(columns.group), model.groups.at(columns.group));
  EXPECT_EQ(Model(queue, rest).read(queue).groups, rest.groups);
  write_model(folder.file("model.ply"), rest);
  const HostModel back = read_model(folder.file("model.ply"));
  EXPECT_EQ(back.groups, rest.groups);
  if (!motion_columns(model.shape).empty() || model.shape.keys > 0) return;
  EXPECT_EQ(back.num_moving(), 2u);
  PlyTable table = read_splats(folder.file("model.ply"));
  const size_t width = table.names.size();
  std::rotate(table.values.begin(), table.values.begin() + long(width), table.values.end());
  write_ply(folder.file("model.ply"), table);
  const HostModel turned = read_model(folder.file("model.ply"));
  EXPECT_EQ(turned.num_moving(), 2u);
  EXPECT_EQ(turned.groups.at("means_t")[1], rest.groups.at("means_t")[0]);
  EXPECT_EQ(turned.groups.at("means_t")[4], rest.groups.at("means_t")[4]);
}

TEST(Model, TablesOfAnotherModelOrNoneAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("model.ply");
  write_model(path, random_model(5, 1, MotionModelKind::keyframes));
  write_model(folder.file("other.ply"), random_model(4, 1, MotionModelKind::keyframes));
  std::filesystem::rename(folder.file("other.motion.npz"), tables_path(path));
  EXPECT_THROW(read_model(path), Error);
  std::filesystem::remove(tables_path(path));
  EXPECT_THROW(read_model(path), Error);
}

// The file's order is that of 3DGS: all coefficients of red, then green, then blue.
TEST(Model, FileHasHigherHarmonicsChannelByChannel) {
  const TemporaryFolder folder;
  HostModel model = random_model(1, 1);
  model.groups["sh_rest"] = {1, 2, 3, 4, 5, 6, 7, 8, 9};  // [3 coefficients, 3 channels]
  write_model(folder.file("model.ply"), model);
  const PlyTable table = read_ply(folder.file("model.ply"));
  const float expected[9] = {1, 4, 7, 2, 5, 8, 3, 6, 9};
  for (int i = 0; i < 9; ++i)
    EXPECT_EQ(table.column_values("f_rest_" + std::to_string(i))[0], expected[i]);
}

TEST(Model, AnEmptyModelComesBackFromAFile) {
  const TemporaryFolder folder;
  write_model(folder.file("model.ply"), random_model(0, 2));
  EXPECT_EQ(read_model(folder.file("model.ply")).count, 0u);
}

TEST(Model, AStandard3dgsFileIsReadAsOneThatStandsStill) {
  const TemporaryFolder folder;
  const PlyTable table = static_table();
  write_ply(folder.file("static.ply"), table);
  const HostModel model = read_model(folder.file("static.ply"));
  EXPECT_EQ(model.count, 2u);
  EXPECT_EQ(model.shape.sh_degree, 1);
  EXPECT_TRUE(is_static(model.shape, model.groups));
  const float* v = table.values.data();
  const size_t w = table.names.size();
  EXPECT_EQ(model.groups.at("means"),
            (std::vector<float>{v[0], v[1], v[2], v[w], v[w + 1], v[w + 2]}));
  EXPECT_TRUE(is_static_model(model));
  EXPECT_FALSE(is_static_model(random_model(3, 0)));
}

TEST(Model, AStandard3dgsFileIsTheSameAtAllTimes) {
  const TemporaryFolder folder;
  write_ply(folder.file("static.ply"), static_table());
  Queue queue = test_queue();
  Model model(queue, read_model(folder.file("static.ply")));
  GaussiansAt first, last;
  model.motion->at(queue, model.parameters, 0, nullptr, first);
  model.motion->at(queue, model.parameters, model.time(1), nullptr, last);
  EXPECT_EQ(first.means.read(queue), last.means.read(queue));
  EXPECT_EQ(first.factors.read(queue), last.factors.read(queue));
  EXPECT_EQ(first.opacities.read(queue), last.opacities.read(queue));
}

// Columns and formulas: optim/formats/splat_dialects.cpp. A weight of 1/255 is not visible.
TEST(Model, AFileOfSpacetimeGaussiansIsReadAsOneThatMoves) {
  const TemporaryFolder folder;
  PlyTable table;
  table.rows = 1;
  table.names = {"x",      "y",      "z",       "trbf_center", "trbf_scale", "f_dc_0",
                 "f_dc_1", "f_dc_2", "opacity", "scale_0",     "scale_1",    "scale_2",
                 "rot_0",  "rot_1",  "rot_2",   "rot_3"};
  for (int k = 0; k < 9; ++k) table.names.push_back("motion_" + std::to_string(k));
  for (int k = 0; k < 4; ++k) table.names.push_back("omega_" + std::to_string(k));
  for (size_t c = 0; c < table.names.size(); ++c) table.values.push_back(0.1f * float(c + 1));
  write_ply(folder.file("lite.ply"), table);
  const HostModel model = read_model(folder.file("lite.ply"));
  const auto columns = [&](const std::string& stem, int first, int last) {
    std::vector<float> values;
    for (int k = first; k <= last; ++k)
      values.push_back(table.column_values(stem + std::to_string(k))[0]);
    return values;
  };
  EXPECT_EQ(model.shape.motion, MotionModelKind::spacetime);
  EXPECT_EQ(model.shape.duration, 1);
  EXPECT_LT(model.shape.cutoff, 1.0 / 255);
  EXPECT_EQ(model.groups.at("means_t"), table.column_values("trbf_center"));
  EXPECT_EQ(model.groups.at("velocities"), columns("motion_", 0, 2));
  EXPECT_EQ(model.groups.at("half_accelerations"), columns("motion_", 3, 5));
  EXPECT_EQ(model.groups.at("turns"), columns("omega_", 0, 3));
  EXPECT_FALSE(is_static_model(model));
}

TEST(Model, APublished3dgsFileIsRead) {
  const std::string path =
      std::string(GFLOW_SOURCE_DIR) + "/../shared/data/splat_models/kacytran_iter7000.ply";
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << "its licence (Inria, research only) forbids shipping it with gflow; the tests "
                    "above read a made file of the same layout";
  const HostModel model = read_model(path);
  EXPECT_EQ(model.count, read_ply(path).rows);
  EXPECT_TRUE(is_static_model(model));
}

TEST(Model, RefusesAFileWithoutAProperty) {
  const TemporaryFolder folder;
  for (const std::string name : {"x", "opacity", "scale_1", "rot_3", "f_dc_1"}) {
    PlyTable table = static_table();
    drop(table, name);
    write_ply(folder.file("broken.ply"), table);
    expect_error([&] { read_model(folder.file("broken.ply")); },
                 {"broken.ply", "'" + name + "' is missing"});
  }
}

TEST(Model, RefusesAMovingFileWithoutItsTime) {
  const TemporaryFolder folder;
  write_model(folder.file("model.ply"), random_model(2, 0));
  PlyTable table = read_ply(folder.file("model.ply"));
  drop(table, "scale_t");
  write_ply(folder.file("broken.ply"), table);
  expect_error([&] { read_model(folder.file("broken.ply")); }, {"'scale_t' is missing"});
}

TEST(Model, LeavesOutGaussiansOfOthersThatCannotBeDrawn) {
  const TemporaryFolder folder;
  for (const float value : {std::nanf(""), HUGE_VALF}) {
    PlyTable table = static_table();
    set(table, 0, "scale_1", value);
    write_ply(folder.file("broken.ply"), table);
    const HostModel model = read_model(folder.file("broken.ply"));
    EXPECT_EQ(model.count, 1u);
    EXPECT_EQ(model.groups.at("means")[0], table.column_values("x")[1]);
    EXPECT_EQ(model.groups.at("sh_rest")[3], table.column_values("f_rest_1")[1]);
  }
}

TEST(Model, LeavesOutGaussiansOfOthersWhoseMotionIsNotFinite) {
  const TemporaryFolder folder;
  const HostModel model = random_model(5, 0);
  write_model(folder.file("model.ply"), model);
  PlyTable table = read_ply(folder.file("model.ply"));
  table.comments.clear();
  set(table, 3, "motion_4", std::nanf(""));
  write_ply(folder.file("other.ply"), table);
  const HostModel read = read_model(folder.file("other.ply"));
  EXPECT_EQ(read.count, 4u);
  EXPECT_EQ(read.groups.at("means_t")[3], model.groups.at("means_t")[4]);
}

// The tables beside the file have a row for each Gaussian.
TEST(Model, RefusesValuesOfItsOwnFilesThatAreNotFinite) {
  const TemporaryFolder folder;
  for (const char* group : {"means", "key_shifts"}) {
    HostModel model = random_model(5, 0, MotionModelKind::keyframes);
    model.groups.at(group)[3] = std::nanf("");
    write_model(folder.file("model.ply"), model);
    expect_error([&] { read_model(folder.file("model.ply")); },
                 {"model.ply", "has NaN or Inf in", group});
  }
}

TEST(Model, RefusesANumberOfHarmonicsThatNoDegreeHas) {
  const TemporaryFolder folder;
  PlyTable table = static_table();
  drop(table, "f_rest_8");
  write_ply(folder.file("broken.ply"), table);
  expect_error([&] { read_model(folder.file("broken.ply")); },
               {"broken.ply", "8 f_rest columns", "0, 9, 24 or 45"});
  table = static_table();
  drop(table, "f_rest_0");
  write_ply(folder.file("broken.ply"), table);
  expect_error([&] { read_model(folder.file("broken.ply")); },
               {"broken.ply", "its 8 f_rest columns are not f_rest_0 to f_rest_7"});
}

TEST(Model, RefusesArraysOfTheWrongLength) {
  Queue queue = test_queue();
  HostModel model = random_model(3, 1);
  model.groups["quats"].pop_back();
  expect_error([&] { Model(queue, model); }, {"3 Gaussians", "12 values of quats"});
  model.groups.erase("quats");
  expect_error([&] { Model(queue, model); }, {"quats"});
}

}  // namespace
}  // namespace gflow
