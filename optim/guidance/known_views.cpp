// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/known_views.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "optim/flow/flow_store.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr size_t kCacheBytes = size_t{256} << 20;

}  // namespace

KnownViews::KnownViews(const std::string& folder)
    : folder_(folder), images_(kCacheBytes), flows_(kCacheBytes) {
  if (!fs::is_directory(folder))
    throw Error(
        fmt::format("guidance.images = \"{}\" is not a folder; it must be a folder of images, or "
                    "of one folder of images per camera",
                    folder));
  const auto images_in = [](const fs::path& place) {
    std::vector<std::string> paths;
    for (const std::string& name : list_images(place.string()))
      paths.push_back((place / name).string());
    return paths;
  };
  of_any_ = images_in(folder);
  for (const std::string& camera : list_folders(folder)) {
    std::vector<std::string> paths = images_in(fs::path(folder) / camera);
    if (!paths.empty()) of_cameras_.emplace(camera, std::move(paths));
  }
  if (of_any_.empty() && of_cameras_.empty())
    throw Error(fmt::format(
        "guidance.images = \"{}\" has no .png or .jpg, neither directly nor in its subfolders",
        folder));
}

std::vector<float> KnownViews::planes(const std::string& path, const GuidanceRequest& request,
                                      const GuidanceView& view) const {
  const int width = view.camera.width, height = view.camera.height;
  const auto whole = images_.get(
      path, [&] { return read_image(path); },
      [](const Image& image) { return image.pixels.size(); });
  constexpr double rounding = 0.02;  // of odd sizes
  if (std::fabs(double(whole->width) * height / (double(whole->height) * width) - 1) > rounding)
    throw GuidanceFailed(fmt::format(
        "image {} has {}x{} pixels, but the view has {}x{}: they must have the same aspect ratio",
        path, whole->width, whole->height, width, height));
  const Image image =
      whole->width == width && whole->height == height ? *whole : resized(*whole, width, height);
  const size_t pixels = size_t(width) * size_t(height), channels = size_t(image.channels);
  std::vector<float> planes(3 * pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const uint8_t* value = &image.pixels[channels * i];
    const float alpha = channels == 4 ? float(value[3]) / 255 : 1.f;
    for (size_t c = 0; c < 3; ++c)
      planes[c * pixels + i] = alpha * float(value[c]) / 255 + (1 - alpha) * request.background[c];
  }
  return planes;
}

std::vector<std::vector<float>> KnownViews::images(const GuidanceRequest& request,
                                                   const GuidanceView& view, bool of_camera) const {
  const size_t k = size_t(request.frame);
  std::vector<std::string> paths;
  const auto its = of_cameras_.find(view.camera.name);
  if (of_camera && its != of_cameras_.end()) {
    if (k < its->second.size()) paths = {its->second[k]};
  } else {
    paths = of_any_;
    for (const auto& [camera, steps] : of_cameras_)
      if (k < steps.size()) paths.push_back(steps[k]);
  }
  if (paths.empty())
    throw GuidanceFailed(fmt::format("guidance.images = \"{}\" has no image of time step {}{}",
                                     folder_, k,
                                     its == of_cameras_.end() ? "" : " by camera " + its->first));
  std::vector<std::vector<float>> found;
  for (const std::string& path : paths) found.push_back(planes(path, request, view));
  return found;
}

std::shared_ptr<const TargetFlow> KnownViews::flow(const GuidanceRequest& request,
                                                   const GuidanceView& view) const {
  const Camera& camera = view.camera;
  if (request.next_frame != request.frame + 1)
    return nullptr;  // the flow of the files leads to the next step
  Frame frame;
  const fs::path base =
      path_below(fs::path(folder_) / "flow", camera.name) / fmt::format("{:04}", request.frame);
  if (!camera.name.empty()) find_true_flow(frame, base.string(), request.next_time);
  if (frame.flow_path.empty()) return nullptr;
  return flows_.get(
      fmt::format("{} {}x{}", frame.flow_path, camera.width, camera.height),
      [&] { return read_true_flow(frame, camera.width, camera.height); },
      [](const TargetFlow& flow) { return 10 * flow.confidence.size(); });
}

}  // namespace gflow
