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
namespace fs = std::filesystem;
namespace {

const char* const multipleview_name = "poses_bounds_multipleview.npy";

constexpr size_t most_named = 12;  // cameras in a message

// By which the rows are sorted.
std::string text_of(const LlffPoses& poses, const LlffCamera& camera) {
  const std::string number = split_number(camera.name).number;
  if (!poses.is_multipleview() || number.empty()) return camera.file;
  const size_t first = std::min(number.find_first_not_of('0'), number.size() - 1);
  return "image" + number.substr(first) + ".jpg";
}

}  // namespace

bool LlffPoses::is_multipleview() const { return fs::path(path).filename() == multipleview_name; }

std::string find_llff_poses(const std::string& folder) {
  return first_existing(folder, {"poses_bounds.npy", multipleview_name});
}

LlffPoses read_llff_poses(const std::string& path) {
  const Array array = read_npy(path);
  if (array.shape.size() != 2 || array.shape[1] != 17)
    throw Error(fmt::format("{} has shape {}, expected (cameras, 17)", path, array.shape_text()));
  return {path, array.shape[0], array.as_double()};
}

std::vector<size_t> order_of_rows(const LlffPoses& poses, const std::vector<LlffCamera>& cameras,
                                  std::vector<std::string>& notices) {
  std::vector<std::string> texts;
  for (const LlffCamera& camera : cameras) texts.push_back(text_of(poses, camera));
  std::vector<size_t> order(cameras.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return texts[a] < texts[b]; });
  const bool by_number = std::is_sorted(order.begin(), order.end(), [&](size_t a, size_t b) {
    return natural_less(texts[a], texts[b]);
  });
  if (by_number) return order;
  std::vector<std::string> names;
  for (const size_t i : order) names.push_back(cameras[i].name);
  const char* const how = poses.is_multipleview()
                              ? "by its number as text, as the script of 4DGaussians writes it"
                              : "in the order of text, as LLFF writes it";
  notices.push_back(fmt::format("row i of {} belongs to the i-th camera {}: {}",
                                fs::path(poses.path).filename().string(), how,
                                short_list(names, most_named)));
  return order;
}

}  // namespace gflow
