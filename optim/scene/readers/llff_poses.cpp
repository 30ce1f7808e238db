// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/llff_poses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "optim/formats/npy.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr size_t most_named = 12;  // cameras in a message

}  // namespace

LlffPoses read_llff_poses(const std::string& path) {
  const Array array = read_npy(path);
  if (array.shape.size() != 2 || array.shape[1] != 17)
    throw Error(fmt::format("{} has shape {}, expected (cameras, 17)", path, array.shape_text()));
  return {path, array.shape[0], array.as_double()};
}

std::vector<size_t> order_of_rows(const LlffPoses& poses, const std::vector<LlffCamera>& cameras,
                                  std::vector<std::string>& notices) {
  std::vector<size_t> order(cameras.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return cameras[a].file < cameras[b].file; });
  const bool by_number = std::is_sorted(order.begin(), order.end(), [&](size_t a, size_t b) {
    return natural_less(cameras[a].file, cameras[b].file);
  });
  if (by_number) return order;
  std::vector<std::string> names;
  for (const size_t i : order) names.push_back(cameras[i].name);
  notices.push_back(fmt::format(
      "row i of {} belongs to the i-th camera in the order of text, as LLFF writes it: "
      "{}",
      std::filesystem::path(poses.path).filename().string(), short_list(names, most_named)));
  return order;
}

}  // namespace gflow
