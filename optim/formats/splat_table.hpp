// SPDX-License-Identifier: Apache-2.0
// Gaussians that stand still, as a standard 3DGS PLY holds them: what every splat file is turned
// into when it is read, and made of when it is written.
#pragma once
#include <array>

#include "optim/formats/ply.hpp"

namespace gflow {

// Where the values of one Gaussian lie in a row of the table.
struct SplatRow {
  float* mean;           // [3] world
  float* sh0;            // [3] colour = 1/2 + SH_C0 sh0
  float* sh_rest;        // [3, K - 1] channel by channel
  float* logit_opacity;  // [1]
  float* log_scales;     // [3]
  float* quat;           // [4] w x y z
};

// Whether a table has columns of normals. They mean nothing, but a standard PLY has them: viewers
// count on each column's place.
enum class Normals { none, zero };

// A table with the columns of a standard 3DGS PLY (x y z, nx ny nz, f_dc_*, f_rest_*, opacity,
// scale_*, rot_*), all zero at first.
struct SplatTable {
  // sh_degree 0 to 3. A table that is read and not written has no need of normals.
  SplatTable(size_t rows, int sh_degree, Normals normals = Normals::zero);
  SplatRow row(size_t i);

  size_t rest;  // number of f_rest columns
  Normals normals;
  PlyTable table;
};

// Error that names `path` where `name` is not among the names of a PLY's properties.
void require_property(const std::vector<std::string>& names, const std::string& name,
                      const std::string& path);

// The standard's columns of any table, a row at a time: where a copy of all would be in the way.
// Error that names `path` when one is missing. The table must outlive it.
class StandardRows {
 public:
  StandardRows(const PlyTable& table, const std::string& path);
  int sh_degree() const { return sh_degree_; }
  // The standard's table but for its values.
  const PlyTable& head() const { return head_; }
  // A PlyRow of it.
  void copy(size_t i, float* values) const;

 private:
  const PlyTable& table_;
  int sh_degree_;
  PlyTable head_;
  std::vector<int> from_;  // of each of its columns the table's; -1: a normal
};

// The same as a copy of all.
SplatTable standard_table(const PlyTable& table, const std::string& path);

// Degree of spherical harmonics that have so many f_rest columns (0, 9, 24, 45), or -1.
int sh_degree_of(size_t rest_columns);
// Error that names `path` instead of -1.
int sh_degree_of(const PlyTable& table, const std::string& path);

// sh0 of a colour channel in [0, 1].
float sh0_of_color(double color);
double color_of_sh0(double sh0);

// Opacities in [0, 1], those at the ends drawn in by a millionth so that their logits are finite.
float logit_of_opacity(double opacity);
double opacity_of_logit(double logit);

enum class SplatFormat { ply, compressed_ply, splat, spz, four_dgs };
constexpr std::array<const char*, 5> names_of(SplatFormat) {
  return {"ply", "compressed-ply", "splat", "spz", "4dgs"};
}

// Format of a file: by its first bytes, and a .splat, which has none of its own, by its name. Error
// when it is none of these.
SplatFormat splat_format(const std::string& path);

// The Gaussians of any splat file, without normals where it has none. A PLY may have more columns
// than the standard's, or fewer: they are what is in the file. Error when it cannot be read as what
// splat_format says, or values that are computed are not finite; and for a .4dgs, whose Gaussians
// move (four_dgs.hpp reads it).
PlyTable read_splats(const std::string& path);
PlyTable read_splats(const std::string& path, SplatFormat format);

}  // namespace gflow
