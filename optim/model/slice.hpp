// SPDX-License-Identifier: Apache-2.0
// A slice of a moving model at one time: static Gaussians that every splat viewer can show.
#pragma once
#include <array>

#include "optim/formats/splat_table.hpp"
#include "optim/model/model.hpp"

namespace gflow {

// Decomposes a factor L [3, 3], row by row: scales s, largest first, and the unit quaternion (w x y
// z) of R with R diag(s)^2 R^T = L L^T.
struct FactorParts {
  std::array<double, 3> scales;
  std::array<double, 4> quat;
};
FactorParts parts_of_factor(const float* factor);

// The Gaussians visible at a scene time in [0, 1], in the model's order, without those below the
// temporal cutoff. For any motion model. Reads them from the device in blocks; queue and model must
// outlive it.
class SliceRows {
 public:
  SliceRows(Queue& queue, Model& model, double scene_time);
  int sh_degree() const { return model_.shape.sh_degree; }
  // The table without its values; row() gives each row (PlyRow).
  const PlyTable& head() const { return table_.table; }
  void row(size_t i, float* values);

 private:
  void fetch(size_t first);

  Queue& queue_;
  Model& model_;
  GaussiansAt at_;
  std::vector<uint32_t> there_;  // of the visible Gaussians
  SplatTable table_;             // without values
  SplatTable one_;
  size_t first_ = 0, count_ = 0;  // range of the model's Gaussians that is loaded
  std::vector<float> means_, factors_, opacities_, sh0_, sh_rest_;
};

// The slice as a table.
SplatTable slice(Queue& queue, Model& model, double scene_time);

}  // namespace gflow
