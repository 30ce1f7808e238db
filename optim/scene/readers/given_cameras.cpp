// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/given_cameras.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <numeric>

#include "optim/scene/cameras_json.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/static_camera.hpp"
#include "optim/scene/readers/transforms_file.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

std::vector<Camera> read_cameras(const std::string& path, const ViewImages& view,
                                 std::vector<std::string>& notices) {
  if (read_json(path).is_object())
    return read_cameras(read_transforms(path), view.width, view.height, view.source, notices);
  std::vector<Camera> cameras = read_cameras_json(path, 1);
  for (Camera& camera : cameras)
    camera = fitted_to(camera, view.width, view.height, path, view.source);
  return cameras;
}

// File name without extension, in lower case.
std::string image_stem(const std::string& name) {
  std::string text = without_image_extension(fs::path(name).filename().string());
  for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// The camera named like each image, -1 if there is none; all -1 if cameras share a name.
std::vector<int> by_name(const std::vector<Camera>& cameras, const ViewImages& view) {
  std::vector<int> of_image(view.count, -1);
  std::map<std::string, int> known;
  for (size_t i = 0; i < cameras.size(); ++i)
    if (!known.emplace(image_stem(cameras[i].name), int(i)).second) return of_image;
  for (size_t k = 0; k < view.count; ++k)
    if (const auto camera = known.find(image_stem(view.names[k])); camera != known.end())
      of_image[k] = camera->second;
  return of_image;
}

// The increasing numbers at the ends of all names, which have one prefix; else empty.
std::vector<size_t> numbers_of(const std::vector<Camera>& cameras) {
  constexpr size_t most_digits = 9;
  std::vector<size_t> numbers;
  std::string prefix;
  for (const Camera& camera : cameras) {
    const Numbered parts = split_number(image_stem(camera.name));
    const bool fits = !parts.number.empty() && parts.number.size() <= most_digits &&
                      (numbers.empty() || parts.prefix == prefix);
    if (!fits) return {};
    const size_t number = std::stoul(parts.number);
    if (!numbers.empty() && number <= numbers.back()) return {};
    prefix = parts.prefix;
    numbers.push_back(number);
  }
  return numbers;
}

// The camera numbered like each frame of a whole video, -1 if there is none; all -1 if it is not
// clear whether the first frame is 0 or 1. Numbers must reach the last tenth of the video: those of
// frames taken from it at a lower rate end before.
std::vector<int> by_number(const std::vector<Camera>& cameras, const ViewImages& view) {
  std::vector<int> of_image(view.count, -1);
  const std::vector<size_t> numbers = numbers_of(cameras);
  if (numbers.empty()) return of_image;
  const bool from_0 = numbers[0] == 0 && numbers.back() < view.count &&
                      double(numbers.back() + 1) >= 0.9 * double(view.count);
  const bool from_1 = numbers[0] >= 1 && numbers.back() == view.count;
  if (from_0 || from_1)
    for (size_t i = 0; i < numbers.size(); ++i) of_image[numbers[i] - size_t(from_1)] = int(i);
  return of_image;
}

// Whether numbered cameras begin with the first image and leave none out.
bool are_without_gaps(const std::vector<Camera>& cameras) {
  const std::vector<size_t> numbers = numbers_of(cameras);
  return numbers.empty() || (numbers[0] <= 1 && numbers.back() - numbers[0] + 1 == numbers.size());
}

ViewCameras one_for_all(const Camera& camera, const ViewImages& view) {
  return {{camera}, std::vector<int>(view.count, 0)};
}

ViewCameras only_used(const ViewCameras& all) {
  ViewCameras used;
  std::vector<int> places(all.cameras.size(), -1);
  for (const int camera : all.of_image) {
    if (camera >= 0 && places[size_t(camera)] < 0) {
      places[size_t(camera)] = int(used.cameras.size());
      used.cameras.push_back(all.cameras[size_t(camera)]);
    }
    used.of_image.push_back(camera < 0 ? -1 : places[size_t(camera)]);
  }
  return used;
}

}  // namespace

void report_no_poses(const SceneOptions& options, std::vector<std::string>& notices) {
  if (options.cameras.empty()) notices.push_back(kNoPoses);
}

ViewCameras cameras_of_view(const SceneOptions& options, const ViewImages& view,
                            std::vector<std::string>& notices) {
  if (options.cameras.empty())
    return one_for_all(static_camera("input", 0, options, view.width, view.height), view);
  std::vector<Camera> cameras = read_cameras(options.cameras, view, notices);
  const bool named = std::none_of(cameras.begin(), cameras.end(),
                                  [](const Camera& camera) { return camera.name.empty(); });
  for (size_t i = 0; i < cameras.size(); ++i)
    if (cameras[i].name.empty()) cameras[i].name = fmt::format("frame_{}", i);
  if (!options.camera.empty()) {
    const auto chosen = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& camera) {
      return camera.name == options.camera || stem(camera.name) == options.camera;
    });
    return one_for_all(chosen != cameras.end() ? *chosen : camera_named(cameras, options.camera),
                       view);
  }
  if (cameras.size() == 1) return one_for_all(cameras[0], view);
  std::stable_sort(cameras.begin(), cameras.end(),
                   [](const Camera& a, const Camera& b) { return natural_less(a.name, b.name); });

  const bool is_video = view.names.empty();
  std::vector<int> of_image(view.count, -1);
  if (named && !is_video) of_image = by_name(cameras, view);
  if (named && is_video && view.is_whole) of_image = by_number(cameras, view);
  const size_t left_out = size_t(std::count(of_image.begin(), of_image.end(), -1));
  if (left_out == 0) return only_used({cameras, of_image});

  const size_t found = view.count - left_out;
  const std::string images = is_video ? "frames of " + view.source
                                      : "images in " + fs::path(view.source).parent_path().string();
  const bool more_frames = !view.is_whole && cameras.size() > view.count;
  if (cameras.size() == view.count || (more_frames && (!named || are_without_gaps(cameras)))) {
    if (found > 0)
      notices.push_back(
          fmt::format("the cameras of {} belong to the {} in order, though only {} of {} names "
                      "agree",
                      options.cameras, images, found, view.count));
    std::iota(of_image.begin(), of_image.end(), 0);
    return only_used({cameras, of_image});
  }
  if (found == 0)
    throw Error(
        fmt::format("{} has {} cameras, but the view of {} has {} images: expected one camera, one "
                    "per image, names that tell to which image each belongs, or the name of one in "
                    "scene.camera",
                    options.cameras, cameras.size(), view.source, view.count));
  notices.push_back(fmt::format("{} of {} {} are left out: {} has no camera of their name",
                                left_out, view.count, images, options.cameras));
  return only_used({cameras, of_image});
}

}  // namespace gflow
