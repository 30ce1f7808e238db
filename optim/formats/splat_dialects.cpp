// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/splat_dialects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <sstream>

#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

constexpr std::array<const char*, 3> kColors = {"red", "green", "blue"};
constexpr std::array<const char*, 3> kSh0 = {"f_dc_0", "f_dc_1", "f_dc_2"};

using Names = std::vector<std::string>;

bool has(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

template <class Wanted>
bool has_all(const Names& names, const Wanted& wanted) {
  return std::all_of(wanted.begin(), wanted.end(),
                     [&](const char* name) { return has(names, name); });
}
bool has_all(const Names& names, std::initializer_list<const char*> wanted) {
  return has_all<>(names, wanted);
}

bool is_point_cloud(const Names& names) {
  return has_all(names, {"x", "y", "z"}) && !has(names, "opacity") && !has(names, "scale_0") &&
         !has(names, "rot_0");
}

bool is_flat(const Names& names) {
  return has_all(names, {"opacity", "scale_0", "scale_1", "rot_0"}) && !has(names, "scale_2");
}

bool is_colored(const Names& names) {
  return has_all(names, {"opacity", "scale_0", "rot_0"}) && has_all(names, kColors) &&
         !has(names, kSh0[0]);
}

bool is_spacetime(const Names& names) { return has_all(names, {"trbf_center", "trbf_scale"}); }

// Calls change(value) for each value of a column.
template <class Change>
void change_column(PlyTable& table, const std::string& name, Change&& change) {
  const size_t columns = table.names.size();
  for (size_t at = size_t(table.column(name)); at < table.values.size(); at += columns)
    change(table.values[at]);
}

void rename(Names& names, const std::string& from, const std::string& to) {
  std::replace(names.begin(), names.end(), from, to);
}

// Adds a last column of equal values, in place.
void append_column(PlyTable& table, const std::string& name, float value) {
  const size_t columns = table.names.size();
  table.names.push_back(name);
  table.values.resize(table.rows * (columns + 1));
  for (size_t i = table.rows; i-- > 0;) {
    const auto row = table.values.begin() + long(i * columns);
    table.values[i * (columns + 1) + columns] = value;
    std::copy_backward(row, row + long(columns), row + long(i + columns));
  }
}

void flatten(PlyTable& table, const std::string& path) {
  append_column(table, "scale_2", log_of_scale(0));
  warn_once(fmt::format(
      "reading {}: it has no scale_2; its Gaussians are read as flat (2D Gaussian Splatting)",
      path));
}

// Value of full intensity of the colour columns.
double full_intensity_of(PlyTable& table, const std::string& path) {
  if (!is_real_property(path, kColors[0])) return 255;
  float largest = 0;
  for (const char* color : kColors)
    change_column(table, color, [&](float value) { largest = std::max(largest, value); });
  return full_intensity(largest);
}

void turn_colors_into_harmonics(PlyTable& table, const std::string& path) {
  const double full = full_intensity_of(table, path);
  for (size_t k = 0; k < 3; ++k) {
    change_column(table, kColors[k], [&](float& value) { value = sh0_of_color(value / full); });
    rename(table.names, kColors[k], kSh0[k]);
  }
}

// With the standard deviation f of the filter [scene units], for each Gaussian
//   scale'^2 = scale^2 + f^2        opacity' = opacity sqrt(prod scale^2 / prod scale'^2)
// (mip-splatting, Yu et al. 2024, get_scaling_with_3D_filter and get_opacity_with_3D_filter).
void apply_filter(float f, float* log_scales[3], float& logit_opacity) {
  double shares = 1;
  for (size_t k = 0; k < 3; ++k) {
    const double before = std::exp(2 * double(*log_scales[k])), after = before + double(f) * f;
    shares *= before / after;
    *log_scales[k] = float(0.5 * std::log(after));
  }
  logit_opacity = logit_of_opacity(opacity_of_logit(logit_opacity) * std::sqrt(shares));
}

void apply_filters(PlyTable& table, const std::string& path) {
  const size_t columns = table.names.size(), filter = size_t(table.column("filter_3D"));
  const size_t opacity = size_t(table.column("opacity"));
  const std::array<int, 3> scales = {table.column("scale_0"), table.column("scale_1"),
                                     table.column("scale_2")};
  for (size_t i = 0; i < table.rows; ++i) {
    float* row = table.values.data() + i * columns;
    float* log_scales[3] = {row + scales[0], row + scales[1], row + scales[2]};
    if (row[filter] != 0) apply_filter(row[filter], log_scales, row[opacity]);
    row[filter] = 0;
  }
  warn_once(fmt::format(
      "reading {}: its 3D filter (filter_3D, mip-splatting) is applied to scales and opacities",
      path));
}

// Error if a network decodes the colours: the full model of SpacetimeGaussians has nine features
// per Gaussian, the lite model three.
void refuse_decoded_colors(const Names& names, const std::string& path) {
  if (!has(names, "f_dc_3") && !has(names, "f_t_0")) return;
  throw Error(fmt::format(
      "cannot read {}: it is a full model of SpacetimeGaussians, whose colours a network makes; "
      "gflow reads its lite model",
      path));
}

// SpacetimeGaussians, Li et al. 2024 (renderer/__init__.py, train_ours_lite). At the time t in
// [0, 1), with tau = t - trbf_center and b = exp(trbf_scale):
//   mean      x + motion_0..2 tau + motion_3..5 tau^2 + motion_6..8 tau^3
//   rotation  rot + omega tau, normalised
//   opacity   sigmoid(opacity) exp(-(tau / b)^2)        colour  f_dc
// This is the motion model spacetime with scale_t = b / sqrt 2, but for the cubic term.
void convert_spacetime(PlyTable& table, const std::string& path) {
  rename(table.names, "trbf_center", "t");
  rename(table.names, "trbf_scale", "scale_t");
  change_column(table, "scale_t", [](float& value) { value -= float(std::log(2) / 2); });
  for (const char* name : kSh0)
    change_column(table, name, [](float& value) { value = sh0_of_color(value); });
  table.comments.push_back("cutoff 0.0039");  // of the temporal weight: one level of 8 bits
  bool cubic = false;
  for (const char* name : {"motion_6", "motion_7", "motion_8"})
    if (has(table.names, name))
      change_column(table, name, [&](float value) { cubic = cubic || value != 0; });
  if (cubic)
    warn_once(fmt::format(
        "reading {}: the cubic term of its paths (motion_6 to motion_8) is left out; gflow has "
        "paths of degree 2",
        path));
}

// Whether test(value) holds for all values of a column.
template <class Test>
bool all_of_column(const PlyTable& table, const std::string& name, Test&& test) {
  const size_t columns = table.names.size();
  for (size_t at = size_t(table.column(name)); at < table.values.size(); at += columns)
    if (!test(table.values[at])) return false;
  return true;
}

// In a trained file some Gaussian is smaller than a scene unit, and some logit is outside 0 to 1.
bool looks_linear(const PlyTable& table) {
  if (table.rows < 2) return false;
  for (const char* scale : {"scale_0", "scale_1", "scale_2"})
    if (has(table.names, scale) &&
        !all_of_column(table, scale, [](float value) { return value > 0; }))
      return false;
  return all_of_column(table, "opacity", [](float value) { return value >= 0 && value <= 1; });
}

// The file or folder of the network that moves the Gaussians of a PLY; empty if there is none.
// 4DGaussians keeps it beside the PLY, Deformable-3D-Gaussians in RUN/deform for
// RUN/point_cloud/iteration_N/point_cloud.ply.
std::string deformation_network(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::path folder = fs::absolute(path, failed).parent_path(), clouds = folder.parent_path();
  const fs::path beside = folder / "deformation.pth", of_run = clouds.parent_path() / "deform";
  if (fs::exists(beside, failed)) return beside.string();
  return clouds.filename() == "point_cloud" && fs::exists(of_run, failed) ? of_run.string() : "";
}

}  // namespace

void warn_of_doubts(const PlyTable& table, const std::string& path) {
  if (looks_linear(table))
    warn_once(
        fmt::format("reading {}: all its scales are positive and all its opacities between 0 and "
                    "1, as if they were lengths and opacities; a PLY has their logarithms and "
                    "logits",
                    path));
  if (const std::string network = deformation_network(path); !network.empty())
    warn_once(
        fmt::format("reading {}: it has the rest pose of the deformation network {}, which gflow "
                    "does not read; export one PLY per time with the program that trained it",
                    path, network));
}

bool is_antialiased(const std::vector<std::string>& comments) {
  bool antialiased = false;
  for (const std::string& comment : comments) {
    std::istringstream words(lower(comment));
    std::string key, value;
    words >> key >> value;
    if (key == "splatrendermode:") antialiased = value == "mip";
    if (key == "antialiased") antialiased = value == "1";
  }
  return antialiased;
}

std::vector<std::string> standard_names(std::vector<std::string> names, const std::string& path) {
  if (is_point_cloud(names))
    throw Error(fmt::format(
        "cannot read {}: it has no opacity, scale_0 and rot_0, so it is a point cloud, not a PLY "
        "of trained Gaussians; a scene takes it as points3D.ply",
        path));
  if (is_spacetime(names)) refuse_decoded_colors(names, path);
  if (is_colored(names))
    for (size_t k = 0; k < 3; ++k) rename(names, kColors[k], kSh0[k]);
  if (is_flat(names)) names.push_back("scale_2");
  return names;
}

PlyTable with_standard_columns(PlyTable table, const std::string& path) {
  if (is_colored(table.names)) turn_colors_into_harmonics(table, path);
  if (is_flat(table.names)) flatten(table, path);
  if (is_spacetime(table.names)) convert_spacetime(table, path);
  if (has(table.names, "filter_3D")) apply_filters(table, path);
  return table;
}

}  // namespace gflow
