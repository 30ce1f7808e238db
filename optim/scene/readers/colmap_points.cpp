// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/colmap_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "optim/scene/similarity.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

std::string without_extension(const std::string& name) {
  return fs::path(name).replace_extension().generic_string();
}

// Whether one path is the other, or its last folders and file name.
bool is_end_of(const std::string& whole, const std::string& end) {
  if (whole.size() < end.size()) return is_end_of(end, whole);
  const size_t at = whole.size() - end.size();
  return whole.compare(at, end.size(), end) == 0 && (at == 0 || whole[at - 1] == '/');
}

// File name without extension -> indices of images.
std::map<std::string, std::vector<size_t>> by_file_name(const std::vector<ColmapImage>& images) {
  std::map<std::string, std::vector<size_t>> found;
  for (size_t i = 0; i < images.size(); ++i)
    found[fs::path(images[i].name).stem().string()].push_back(i);
  return found;
}

}  // namespace

std::pair<std::vector<Camera>, std::vector<Camera>> common_cameras(
    const std::vector<ColmapImage>& a, const std::vector<ColmapImage>& b) {
  std::pair<std::vector<Camera>, std::vector<Camera>> common;
  const auto in_b = by_file_name(b);
  for (const auto& [name, ours] : by_file_name(a)) {
    const auto found = in_b.find(name);
    if (found == in_b.end()) continue;
    const std::vector<size_t>& theirs = found->second;
    for (const size_t i : ours) {
      std::vector<size_t> fitting;
      for (const size_t j : theirs)
        if ((ours.size() == 1 && theirs.size() == 1) ||
            is_end_of(without_extension(a[i].name), without_extension(b[j].name)))
          fitting.push_back(j);
      if (fitting.size() != 1) continue;
      common.first.push_back(a[i].camera);
      common.second.push_back(b[fitting[0]].camera);
    }
  }
  return common;
}

PointCloud points_in_world_of(const std::vector<ColmapImage>& images, const std::string& source,
                              const std::string& model_folder, std::vector<std::string>& notices) {
  const auto leave_out = [&](const std::string& why) {
    notices.push_back(
        fmt::format("the points of COLMAP model {} are not used: {}", model_folder, why));
    return PointCloud{};
  };
  if (!is_colmap_model(model_folder)) {
    const bool none = read_colmap_points(model_folder).size() == 0;
    return none ? PointCloud{} : leave_out("it has no cameras, which would tell its coordinates");
  }
  ColmapModel model = read_colmap_model(model_folder);
  if (model.points.size() == 0) return {};
  const auto [from, to] = common_cameras(model.images, images);
  if (from.size() < 3)
    return leave_out(
        fmt::format("aligning them to the cameras of {} needs three images that both name, but "
                    "there are {}",
                    source, from.size()));
  if (!align_points(model.points, from, to))
    return leave_out(fmt::format("its cameras do not agree with those of {}", source));
  return model.points;
}

}  // namespace gflow
