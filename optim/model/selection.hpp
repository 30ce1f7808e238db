// SPDX-License-Identifier: Apache-2.0
// A part of a model: what the filters of a viewer leave.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "optim/model/model.hpp"

namespace gflow {

struct Selection {
  double min_opacity = 0;  // of the greatest opacity over time, [0, 1]
  double max_size = 0;     // of the longest standard deviation at rest [scene units]; 0: any
  // Least x, y, z and greatest x, y, z of the means while visible [world coordinates].
  std::optional<std::array<double, 6>> crop;

  bool is_everything() const { return min_opacity == 0 && max_size == 0 && !crop; }
};

// The Gaussians that meet the selection and are visible, within the box, at one of the scene times
// at least, in the model's order. Motion that Gaussians share stays whole. The result may be empty.
HostModel selected(Queue& queue, const HostModel& model, const Selection& selection,
                   const std::vector<double>& times);

// Error if nothing is left of the `whole` Gaussians of `path`.
void require_some_left(const HostModel& left, size_t whole, const std::string& path);

}  // namespace gflow
