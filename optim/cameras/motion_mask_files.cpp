// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/motion_mask_files.hpp"

#include <algorithm>
#include <filesystem>

#include "optim/cameras/camera_scene.hpp"
#include "optim/cameras/quick_motion_masks.hpp"

namespace gflow {
namespace {

constexpr int kComparedSide = 320;  // of the longer side of the images compared [px]

// Resamples an image of a lens without distortion, or back, by where each pixel comes from.
template <class From>
Image resampled(const Image& image, From&& from) {
  std::vector<float> places;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Eigen::Vector2d p = from(Eigen::Vector2d(x + 0.5, y + 0.5));
      places.insert(places.end(), {float(p.x()), float(p.y())});
    }
  return remapped(image, image.width, image.height, places);
}

Image without_distortion(const Image& image, const SharedLens& lens) {
  if (lens.k1 == 0) return image;
  return resampled(image, [&](const Eigen::Vector2d& p) {
    const Eigen::Vector2d q = (p - lens.centre) / lens.focal;
    return lens.project({q.x(), q.y(), 1});
  });
}

Image with_distortion(const Image& image, const SharedLens& lens) {
  if (lens.k1 == 0) return image;
  return resampled(image, [&](const Eigen::Vector2d& p) {
    return Eigen::Vector2d(lens.centre + lens.focal * lens.unproject(p).head<2>());
  });
}

// The frames that have a pose, reduced, and their numbers in the video.
SmallVideo placed_frames(const LoadedScene& video, const CameraPath& path,
                         std::vector<size_t>& numbers) {
  SmallVideo small;
  for (size_t k = 0; k < path.poses.size(); ++k) {
    if (!path.poses[k]) continue;
    const Frame& frame = video.scene.train[k];
    Camera camera = video.frames->camera(frame);
    camera.fx = camera.fy = path.lens.focal;
    camera.cx = path.lens.centre.x(), camera.cy = path.lens.centre.y();
    camera.viewmat = path.poses[k]->matrix();
    small.frames.push_back(&frame);
    small.cameras.push_back(limited(camera, kComparedSide));
    small.images.push_back(resized(without_distortion(*video.frames->rgb(frame), path.lens),
                                   small.width(), small.height()));
    numbers.push_back(k);
  }
  return small;
}

}  // namespace

double write_motion_mask_files(const std::string& folder, const LoadedScene& video,
                               const CameraPath& path, const ProgressCallback& progress) {
  std::vector<size_t> numbers;
  const SmallVideo small = placed_frames(video, path, numbers);
  const std::vector<Mask> masks = quick_motion_masks(small, progress);
  std::filesystem::create_directories(folder);
  double moving = 0;
  for (size_t i = 0; i < masks.size(); ++i) {
    Image image{masks[i].width, masks[i].height, 1, masks[i].pixels};
    for (uint8_t& pixel : image.pixels) pixel = pixel ? 0 : 255;
    const Camera& full = video.frames->camera(*small.frames[i]);
    image = with_distortion(resized(image, full.width, full.height), path.lens);
    for (uint8_t& pixel : image.pixels) pixel = pixel < 128 ? 0 : 255;
    moving += double(std::count(image.pixels.begin(), image.pixels.end(), 0)) /
              double(image.pixels.size() * masks.size());
    write_png(folder + "/" + image_name(numbers[i]), image);
  }
  return moving;
}

}  // namespace gflow
