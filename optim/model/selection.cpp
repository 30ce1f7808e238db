// SPDX-License-Identifier: Apache-2.0
#include "optim/model/selection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

bool meets_at_any_time(const Selection& selection, const HostModel& model, size_t i) {
  const double opacity = 1 / (1 + std::exp(-double(model.groups.at("logit_opacities")[i])));
  return opacity >= selection.min_opacity &&
         (selection.max_size == 0 || longest_scale(model, i) <= selection.max_size);
}

bool is_inside(const std::array<double, 6>& box, const float* mean,
               const std::array<double, 3>& origin) {
  for (size_t k = 0; k < 3; ++k) {
    const double x = double(mean[k]) + origin[k];
    if (!(x >= box[k] && x <= box[3 + k])) return false;
  }
  return true;
}

// Of each block of `rows.size()` rows, those that are kept.
void keep_rows(std::vector<float>& values, size_t width, const std::vector<uint32_t>& kept,
               size_t rows, size_t blocks) {
  std::vector<float> left;
  left.reserve(blocks * kept.size() * width);
  for (size_t b = 0; b < blocks; ++b)
    for (const uint32_t i : kept) {
      const auto row = values.begin() + long((b * rows + i) * width);
      left.insert(left.end(), row, row + long(width));
    }
  values = std::move(left);
}

}  // namespace

HostModel selected(Queue& queue, const HostModel& host, const Selection& selection,
                   const std::vector<double>& times) {
  const size_t n = host.count;
  std::vector<char> seen(n, 0);
  if (n > 0) {
    Model model(queue, host, Purpose::rendering);
    GaussiansAt at;
    for (const double time : times) {
      model.motion->at(queue, model.parameters, model.time(time), nullptr, at);
      const std::vector<float> means = at.means.read_range(queue, 0, 3 * n),
                               opacities = at.opacities.read_range(queue, 0, n);
      for (size_t i = 0; i < n; ++i)
        seen[i] |=
            char(opacities[i] > 0 &&
                 (!selection.crop || is_inside(*selection.crop, &means[3 * i], host.shape.origin)));
    }
  }
  std::vector<uint32_t> kept;
  for (size_t i = 0; i < n; ++i)
    if (seen[i] && meets_at_any_time(selection, host, i)) kept.push_back(uint32_t(i));

  HostModel result = host;
  result.count = kept.size();
  result.moving =
      size_t(std::lower_bound(kept.begin(), kept.end(), host.num_moving()) - kept.begin());
  for (const GroupSpec& group : model_groups(host.shape))
    keep_rows(result.groups.at(group.name), group.width, kept, n, 1);
  for (const TableSpec& table : motion_tables(host.shape))
    for (const GroupSpec& group : table.groups)
      if (table.keys > 0) keep_rows(result.groups.at(group.name), group.width, kept, n, table.keys);
  return result;
}

void require_some_left(const HostModel& left, size_t whole, const std::string& path) {
  if (left.count > 0) return;
  throw Error(
      fmt::format("exporting {}: none of its {} Gaussians is left; select more with a smaller "
                  "--min-opacity, a larger --max-size or --crop (world coordinates)",
                  path, whole));
}

}  // namespace gflow
