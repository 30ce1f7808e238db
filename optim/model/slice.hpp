// SPDX-License-Identifier: Apache-2.0
// A moving model at one time, as Gaussians that stand still: what every viewer of static splats can
// show.
#pragma once
#include <array>

#include "optim/formats/splat_table.hpp"
#include "optim/model/model.hpp"

namespace gflow {

// Scales s, largest first, and the unit quaternion (w x y z) of R with R diag(s)^2 R^T = L L^T.
// L [3, 3], row by row.
struct FactorParts {
  std::array<double, 3> scales;
  std::array<double, 4> quat;
};
FactorParts parts_of_factor(const float* factor);

// The Gaussians that are there at a scene time in [0, 1], in the model's order; those below the
// temporal cutoff are left out. For any motion model. They are fetched from the device a piece at a
// time: the queue and the model must outlive it.
class SliceRows {
 public:
  SliceRows(Queue& queue, Model& model, double scene_time);
  int sh_degree() const { return model_.shape.sh_degree; }
  // The table of them but for its values, and a PlyRow of it.
  const PlyTable& head() const { return table_.table; }
  void row(size_t i, float* values);

 private:
  void fetch(size_t first);

  Queue& queue_;
  Model& model_;
  GaussiansAt at_;
  std::vector<uint32_t> there_;  // indices in the model
  SplatTable table_;             // without values
  SplatTable one_;
  size_t first_ = 0, count_ = 0;  // of the model's Gaussians, those fetched
  std::vector<float> means_, factors_, opacities_, sh0_, sh_rest_;
};

// The same as a table.
SplatTable slice(Queue& queue, Model& model, double scene_time);

}  // namespace gflow
