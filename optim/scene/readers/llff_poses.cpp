// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/llff_poses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <set>

#include "optim/formats/npy.hpp"
#include "optim/scene/camera_settings.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/text_file.hpp"

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

std::string file_name(const std::string& path) { return fs::path(path).filename().string(); }

// The names in a list of one image per line, without extension.
std::set<std::string> stems_in(const std::string& path) {
  const std::string text = read_text_or_empty(path);
  std::set<std::string> stems;
  for (std::string_view rest = text; !rest.empty();) {
    std::string line(take_line(rest));
    line.erase(line.find_last_not_of(" \t\r") + 1);
    if (!line.empty()) stems.insert(stem(with_slashes(line)));
  }
  return stems;
}

// Indices of the cameras in the order of the rows.
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
                                file_name(poses.path), how, short_list(names, most_named)));
  return order;
}

// Adds the cameras of a list that are not among the others, as if their files were named alike.
void add_absent(const std::string& list, std::vector<LlffCamera>& cameras) {
  const std::string ending = cameras[0].file.substr(cameras[0].name.size());
  for (const std::string& name : entries_of(list))
    if (std::none_of(cameras.begin(), cameras.end(),
                     [&](const LlffCamera& camera) { return camera.name == name; }))
      cameras.push_back({name, name + ending});
}

std::vector<bool> skipped_of(const std::vector<LlffCamera>& cameras, const std::string& list) {
  std::vector<Camera> named;
  for (const LlffCamera& camera : cameras) named.emplace_back().name = camera.name;
  return skipped_cameras(named, list);
}

Error unequal(const LlffPoses& poses, const std::string& folder,
              const std::vector<LlffCamera>& found) {
  std::vector<std::string> names;
  for (const LlffCamera& camera : found) names.push_back(camera.name);
  return Error(
      fmt::format("{} has {} rows, one per camera, but {} has images or videos of {} cameras ({}): "
                  "scene.skip_cameras must name the cameras that have only one of the two",
                  poses.path, poses.rows, folder, found.size(), short_list(names, most_named)));
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

std::vector<std::string> images_with_poses(const LlffPoses& poses, const std::string& image_folder,
                                           const std::vector<std::string>& images,
                                           std::vector<std::string>& notices) {
  const std::string list = (fs::path(poses.path).parent_path() / "view_imgs.txt").string();
  if (images.size() == poses.rows || !fs::exists(list)) return images;
  const std::set<std::string> named = stems_in(list);
  std::vector<std::string> kept;
  for (const std::string& image : images)
    if (named.count(stem(image))) kept.push_back(image);
  if (kept.empty() && !images.empty())
    throw Error(
        fmt::format("{} names none of the images in {}: expected a folder with the images that "
                    "{} was made from, which scene.images selects",
                    list, image_folder, file_name(poses.path)));
  if (kept.size() < images.size())
    notices.push_back(
        fmt::format("{} of {} images in {} are left out: view_imgs.txt, which lists "
                    "those with a pose, does not name them",
                    images.size() - kept.size(), images.size(), image_folder));
  return kept;
}

LlffRows assign_rows(const LlffPoses& poses, const std::string& folder,
                     const std::vector<LlffCamera>& found, const std::string& skip,
                     std::vector<std::string>& notices) {
  std::vector<LlffCamera> cameras = found;
  if (poses.rows != found.size()) add_absent(skip, cameras);
  const std::vector<bool> skipped = skipped_of(cameras, skip);
  std::vector<LlffCamera> with_row;
  std::vector<size_t> places;  // in `cameras`
  std::vector<std::string> without;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (poses.rows != cameras.size() && skipped[i]) {
      without.push_back(cameras[i].name);
      continue;
    }
    with_row.push_back(cameras[i]);
    places.push_back(i);
  }
  if (with_row.size() != poses.rows) throw unequal(poses, folder, found);
  if (!without.empty())
    notices.push_back(
        fmt::format("{} is taken to have no row for {}, left out by "
                    "scene.skip_cameras: its rows belong to the other cameras",
                    file_name(poses.path), short_list(without, most_named)));
  LlffRows result{std::vector<int>(found.size(), -1), skipped};
  result.skipped.resize(found.size());
  const std::vector<size_t> order = order_of_rows(poses, with_row, notices);
  for (size_t row = 0; row < order.size(); ++row) {
    const size_t camera = places[order[row]];
    if (camera < found.size())
      result.rows[camera] = int(row);
    else
      notices.push_back(fmt::format("row {} of {} is left out as that of {}, which has no images",
                                    row, file_name(poses.path), cameras[camera].name));
  }
  return result;
}

}  // namespace gflow
