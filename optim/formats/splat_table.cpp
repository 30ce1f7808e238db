// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/splat_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "optim/formats/compressed_ply.hpp"
#include "optim/formats/dot_splat.hpp"
#include "optim/formats/four_dgs.hpp"
#include "optim/formats/ply_comments.hpp"
#include "optim/formats/splat_dialects.hpp"
#include "optim/formats/spz.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/is_zip.hpp"
#include "shared/sh.h"

namespace gflow {
namespace {

constexpr double kOpacityEnd = 1e-6;

void append_numbered(std::vector<std::string>& names, const std::string& stem, size_t count) {
  for (size_t i = 0; i < count; ++i) names.push_back(stem + std::to_string(i));
}

}  // namespace

SplatTable::SplatTable(size_t rows, int sh_degree, Normals normals)
    : rest(size_t(3 * ((sh_degree + 1) * (sh_degree + 1) - 1))), normals(normals) {
  table.rows = rows;
  table.names = {"x", "y", "z"};
  if (normals == Normals::zero) table.names.insert(table.names.end(), {"nx", "ny", "nz"});
  append_numbered(table.names, "f_dc_", 3);
  append_numbered(table.names, "f_rest_", rest);
  table.names.push_back("opacity");
  append_numbered(table.names, "scale_", 3);
  append_numbered(table.names, "rot_", 4);
  table.values.assign(rows * table.names.size(), 0.f);
}

SplatRow SplatTable::row(size_t i) {
  float* mean = table.values.data() + i * table.names.size();
  float* sh0 = mean + (normals == Normals::zero ? 6 : 3);
  float* after = sh0 + 3 + rest;
  return {mean, sh0, sh0 + 3, after, after + 1, after + 4};
}

int sh_degree_of(size_t rest_columns) {
  for (int degree = 0; degree <= 3; ++degree)
    if (rest_columns == size_t(3 * ((degree + 1) * (degree + 1) - 1))) return degree;
  return -1;
}

int sh_degree_of(const PlyTable& table, const std::string& path) {
  size_t columns = 0;
  while (table.column("f_rest_" + std::to_string(columns)) >= 0) ++columns;
  const auto named =
      std::count_if(table.names.begin(), table.names.end(),
                    [](const std::string& name) { return name.rfind("f_rest_", 0) == 0; });
  if (size_t(named) != columns)
    throw Error(fmt::format("cannot read {}: its {} f_rest columns are not f_rest_0 to f_rest_{}",
                            path, named, named - 1));
  const int degree = sh_degree_of(columns);
  if (degree < 0)
    throw Error(fmt::format("cannot read {}: it has {} f_rest columns, expected 0, 9, 24 or 45",
                            path, columns));
  return degree;
}

void require_property(const std::vector<std::string>& names, const std::string& name,
                      const std::string& path) {
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw Error(fmt::format(
        "cannot read {}: property '{}' is missing; it is not a PLY of trained Gaussians", path,
        name));
}

namespace {

// Error if a column of the standard table is missing.
void require_columns(const std::vector<std::string>& names, int sh_degree,
                     const std::string& path) {
  for (const std::string& name : SplatTable(0, sh_degree, Normals::none).table.names)
    require_property(names, name, path);
}

}  // namespace

StandardRows::StandardRows(const PlyTable& table, const std::string& path)
    : table_(table), sh_degree_(sh_degree_of(table, path)), head_(SplatTable(0, sh_degree_).table) {
  require_columns(table.names, sh_degree_, path);
  head_.rows = table.rows;
  head_.origin = table.origin;
  if (is_antialiased(table.comments)) head_.comments = {antialiased_comment};
  for (const std::string& name : head_.names) from_.push_back(table.column(name));
}

void StandardRows::copy(size_t i, float* values) const {
  const float* row = table_.values.data() + i * table_.names.size();
  for (const int from : from_) *values++ = from < 0 ? 0 : row[from];
}

SplatTable standard_table(const PlyTable& table, const std::string& path) {
  const StandardRows rows(table, path);
  SplatTable result(table.rows, rows.sh_degree());
  result.table.origin = table.origin;
  const size_t columns = result.table.names.size();
  for (size_t i = 0; i < table.rows; ++i) rows.copy(i, &result.table.values[i * columns]);
  return result;
}

float sh0_of_color(double color) { return float((color - 0.5) / SH_C0); }
double color_of_sh0(double sh0) { return 0.5 + SH_C0 * sh0; }

float logit_of_opacity(double opacity) {
  const double inside = std::clamp(opacity, kOpacityEnd, 1 - kOpacityEnd);
  return float(std::log(inside / (1 - inside)));
}
double opacity_of_logit(double logit) { return 1 / (1 + std::exp(-logit)); }

float log_of_scale(float scale) {
  return std::log(std::max(scale, std::numeric_limits<float>::min()));
}

SplatFormat splat_format(const std::string& path) {
  require_file(path);
  std::ifstream file(path, std::ios::binary);
  char start[6] = {};
  file.read(start, 5);
  if (file.gcount() < 3) throw Error("cannot read " + path + ": it has fewer than three bytes");
  if (is_four_dgs(start)) return SplatFormat::four_dgs;
  const std::string first(start, 3);
  if (first == "ply")
    return is_compressed(ply_vertex_properties(path)) ? SplatFormat::compressed_ply
                                                      : SplatFormat::ply;
  if (first == "NGS" || first.substr(0, 2) == "\x1f\x8b") return SplatFormat::spz;
  const std::string extension = lower(std::filesystem::path(path).extension().string());
  if (extension == ".splat") return SplatFormat::splat;
  if (extension != ".sog" && is_zip(path))  // .sog is a zip archive of images
    throw Error("cannot read " + path + ": it is a zip archive; unpack it first");
  throw Error(
      fmt::format("cannot read {}: unknown splat format; gflow reads .ply, compressed .ply, "
                  ".splat, .spz (versions 2 to 4) and .4dgs",
                  path));
}

namespace {

// Writers take the logit of an opacity of 0 or 1 and the log of a scale of 0, which are infinite.
PlyTable with_finite_ends(PlyTable table) {
  const size_t columns = table.names.size();
  const auto each = [&](const std::string& name, auto&& change) {
    for (size_t at = size_t(table.column(name)); at < table.values.size(); at += columns)
      if (std::isinf(table.values[at])) change(table.values[at]);
  };
  each("opacity", [](float& logit) { logit = logit_of_opacity(logit > 0 ? 1 : 0); });
  for (const char* name : {"scale_0", "scale_1", "scale_2"})
    each(name, [](float& log_scale) {
      if (log_scale < 0) log_scale = log_of_scale(0);
    });
  return table;
}

// Columns of Gaussians in motion (optim/model/model.cpp).
bool is_motion(const std::string& name) {
  const auto begins = [&](const char* start) { return name.rfind(start, 0) == 0; };
  return name == "t" || name == "scale_t" || begins("motion_") || begins("omega_") ||
         begins("rot_r_");
}

// Finds the rows that cannot be drawn. Normals and unknown columns may have any value.
class RowCheck {
 public:
  RowCheck(const PlyTable& table, const std::string& path) : names_(table.names) {
    const SplatTable standard(0, sh_degree_of(table, path), Normals::none);
    for (const std::string& name : standard.table.names) used_.push_back(table.column(name));
    for (size_t c = 0; c < names_.size(); ++c)
      if (is_motion(names_[c])) used_.push_back(int(c));
    for (size_t k = 0; k < 4; ++k) quat_[k] = table.column("rot_" + std::to_string(k));
  }

  // What is wrong with a row, or nothing.
  std::string problem(const float* row) const {
    for (const int column : used_)
      if (!std::isfinite(row[column])) return "NaN or Inf in " + names_[size_t(column)];
    const bool turned = std::any_of(quat_.begin(), quat_.end(), [&](int c) { return row[c] != 0; });
    return turned ? "" : "the rotation 0 0 0 0";
  }

 private:
  const std::vector<std::string>& names_;
  std::vector<int> used_;
  std::array<int, 4> quat_;
};

// Removes or refuses rows that cannot be drawn. Rows of a file of gflow stay: the tables beside it
// have as many, and read_model rejects the values.
PlyTable drawable(PlyTable table, const std::string& path, Undrawable undrawable) {
  if (comment_after(table, model_comment)) return table;
  const RowCheck check(table, path);
  const size_t columns = table.names.size();
  size_t kept = 0, first = 0;
  std::string why;  // of the first
  for (size_t i = 0; i < table.rows; ++i) {
    const float* row = table.values.data() + i * columns;
    const std::string problem = check.problem(row);
    if (!problem.empty()) {
      if (why.empty()) first = i, why = problem;
      continue;
    }
    if (kept < i) std::copy_n(row, columns, table.values.data() + kept * columns);
    ++kept;
  }
  if (kept == table.rows) return table;
  const std::string which = fmt::format("the first is Gaussian {}, which has {}", first, why);
  if (kept == 0 || undrawable == Undrawable::refused)
    throw Error(fmt::format("cannot read {}: {} of its {} Gaussians cannot be drawn; {}", path,
                            table.rows - kept, table.rows, which));
  warn_once(fmt::format("{} of the {} Gaussians in {} cannot be drawn and are left out; {}",
                        table.rows - kept, table.rows, path, which));
  table.rows = kept;
  table.values.resize(kept * columns);
  return table;
}

PlyTable read_unchecked(const std::string& path, SplatFormat format) {
  if (format == SplatFormat::ply) {
    // Checked before memory is allocated.
    require_columns(standard_names(ply_vertex_properties(path), path), 0, path);
    PlyTable table = read_ply(path);
    if (!comment_after(table, model_comment)) warn_of_doubts(table, path);
    return with_standard_columns(std::move(table), path);
  }
  if (format == SplatFormat::compressed_ply) return read_compressed_ply(path);
  if (format == SplatFormat::spz) return read_spz(path);
  if (format == SplatFormat::four_dgs)
    throw Error(
        fmt::format("{} is a .4dgs file of moving Gaussians; `gflow import {} --time SECONDS -o "
                    "now.ply` writes a PLY of one time",
                    path, path));
  return read_dot_splat(path);
}

}  // namespace

PlyTable read_splats(const std::string& path, Undrawable undrawable) {
  return read_splats(path, splat_format(path), undrawable);
}

PlyTable read_splats(const std::string& path, SplatFormat format, Undrawable undrawable) {
  PlyTable table = read_unchecked(path, format);
  if (is_antialiased(table.comments))
    warn_once(fmt::format(
        "reading {}: its Gaussians were trained with antialiasing, which gflow does not draw: thin "
        "Gaussians look too opaque; train without antialiasing for exact images",
        path));
  return drawable(with_finite_ends(std::move(table)), path, undrawable);
}

}  // namespace gflow
