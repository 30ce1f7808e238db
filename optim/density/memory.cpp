// SPDX-License-Identifier: Apache-2.0
#include "optim/density/memory.hpp"

#include <algorithm>

namespace gflow {
namespace {

// Intersections per Gaussian: 5.5 in `gflow bench raster` at 30 000 Gaussians, 512 x 512 pixels.
constexpr size_t intersections = 6;

// 4-byte words per Gaussian for rendering and its gradients (optim/engine).
constexpr size_t drawing_words = 2 * 13                       // GaussiansAt, at two times
                                 + 3 + 30                     // colours, GaussianGradients
                                 + 16 + 2 + 3                 // Splats
                                 + 16 + 1                     // moments, slot_offsets
                                 + 4                          // ViewRows
                                 + 6                          // sorts; density control's own
                                 + intersections * (16 + 3);  // partials; ids, slots and masks

// Visits the tables with rows per Gaussian, with the number of rows per Gaussian.
template <class Visit>
void for_each_own_table(const Parameters& p, Visit&& visit) {
  visit(static_cast<const Table&>(p), size_t(1));
  for (size_t t = 0; t < p.more.size(); ++t)
    if (p.more_specs[t].keys) visit(p.more[t], p.more_specs[t].keys);
}

}  // namespace

size_t bytes_per_gaussian(const Parameters& parameters, bool remembers) {
  size_t words = 0;
  for_each_own_table(parameters, [&](const Table& table, size_t keys) {
    // values, gradients, two moments
    const size_t arrays = &table == &parameters && !remembers ? 3 : 4;
    for (const GroupSpec& spec : table.specs) words += keys * arrays * spec.width;
    words += keys * 10;  // RowState
  });
  // Tables count twice, old and new. Render buffers get a quarter of slack (Buffer::ensure).
  return 4 * (2 * words + drawing_words * 5 / 4);
}

size_t most_gaussians(const DeviceInfo& device, const Parameters& parameters, size_t budget,
                      bool remembers) {
  const uint64_t bytes = budget ? uint64_t(budget) << 20 : device.global_memory / 4 * 3;
  size_t widest = intersections * 16 * 5 / 4;  // words per Gaussian in one array: the partials
  for_each_own_table(parameters, [&](const Table& table, size_t keys) {
    for (const GroupSpec& spec : table.specs) widest = std::max(widest, keys * spec.width);
  });
  return size_t(std::min(bytes / bytes_per_gaussian(parameters, remembers),
                         device.max_allocation / (4 * widest)));
}

}  // namespace gflow
