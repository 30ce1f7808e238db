// SPDX-License-Identifier: Apache-2.0
// Static Gaussians with the columns of a standard 3DGS PLY: the common form of all splat files.
#pragma once
#include <array>

#include "optim/formats/ply.hpp"

namespace gflow {

// The values of one Gaussian in a row of the table.
struct SplatRow {
  float* mean;           // [3] world
  float* sh0;            // [3] colour = 1/2 + SH_C0 sh0
  float* sh_rest;        // [3, K - 1], channel by channel
  float* logit_opacity;  // [1]
  float* log_scales;     // [3]
  float* quat;           // [4] w x y z
};

// Whether a table has normals. Their values are unused, but viewers expect the columns of a
// standard PLY at fixed places.
enum class Normals { none, zero };

// A table with the columns of a standard 3DGS PLY (x y z, nx ny nz, f_dc_*, f_rest_*, opacity,
// scale_*, rot_*), initially zero.
struct SplatTable {
  // sh_degree 0 to 3. Tables that are only read need no normals.
  SplatTable(size_t rows, int sh_degree, Normals normals = Normals::zero);
  SplatRow row(size_t i);

  size_t rest;  // number of f_rest columns
  Normals normals;
  PlyTable table;
};

// Error that names `path` if `name` is not among the property names of a PLY.
void require_property(const std::vector<std::string>& names, const std::string& name,
                      const std::string& path);

// The standard columns of any table, row by row, without a copy of the table. Error that names
// `path` if a column is missing. Keeps a reference to the table.
class StandardRows {
 public:
  StandardRows(const PlyTable& table, const std::string& path);
  int sh_degree() const { return sh_degree_; }
  // The standard table without its values. Of the comments, only that on antialiasing is kept.
  const PlyTable& head() const { return head_; }
  // Row i; has the signature of PlyRow.
  void copy(size_t i, float* values) const;

 private:
  const PlyTable& table_;
  int sh_degree_;
  PlyTable head_;
  std::vector<int> from_;  // per standard column: the column of the table; -1: a normal
};

// The standard columns of any table as a copy. Errors as StandardRows.
SplatTable standard_table(const PlyTable& table, const std::string& path);

// SH degree for this number of f_rest columns (0, 9, 24 or 45), or -1.
int sh_degree_of(size_t rest_columns);
// The same for a table. Error that names `path` if the f_rest columns fit no degree.
int sh_degree_of(const PlyTable& table, const std::string& path);

// SH coefficient of degree 0 from a colour channel in [0, 1].
float sh0_of_color(double color);
double color_of_sh0(double sh0);

// Logit of an opacity in [0, 1], clamped to [1e-6, 1 - 1e-6] so that it is finite.
float logit_of_opacity(double opacity);
double opacity_of_logit(double logit);

// Log of a scale, at least the smallest normal float so that it is finite.
float log_of_scale(float scale);

enum class SplatFormat { ply, compressed_ply, splat, spz, four_dgs };
constexpr std::array<const char*, 5> names_of(SplatFormat) {
  return {"ply", "compressed-ply", "splat", "spz", "4dgs"};
}

// Format of a file by its first bytes; .splat has no magic number and is recognised by its
// extension. Error if it is none of these.
SplatFormat splat_format(const std::string& path);

// What happens to Gaussians that cannot be drawn.
enum class Undrawable { left_out, refused };

// Reads any splat file but .4dgs (see four_dgs.hpp), without normals if it has none. The columns of
// a plain PLY are those of the file, more or fewer than the standard ones, after conversion from
// the form of other programs (splat_dialects.hpp). Logits of +-Inf (opacity
// 1 or 0) and log scales of -Inf (scale 0) become finite by logit_of_opacity and log_of_scale.
// Gaussians with any other NaN or Inf or with a quaternion of 0 are left out with one warning, or
// refused with an Error, but kept in a file of gflow. Error if the file is not of its format or no
// Gaussian remains.
PlyTable read_splats(const std::string& path, Undrawable undrawable = Undrawable::left_out);
PlyTable read_splats(const std::string& path, SplatFormat format,
                     Undrawable undrawable = Undrawable::left_out);

}  // namespace gflow
