// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/motion_masks.hpp"

#include <filesystem>
#include <map>

#include "optim/init/motion_mask.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace {

Image image_of(const Mask& mask) {
  Image image{mask.width, mask.height, 1, mask.pixels};
  for (uint8_t& pixel : image.pixels) pixel = pixel ? 255 : 0;
  return image;
}

}  // namespace

void write_motion_masks(const std::string& folder, const MotionMasks& masks) {
  if (masks.empty()) return;
  std::filesystem::create_directories(folder);
  for (const auto& [name, mask] : masks)
    write_png(path_below(folder, name + ".png").string(), image_of(mask));
}

MotionMasks read_motion_masks(const std::string& folder, const Scene& scene) {
  MotionMasks masks;
  try {
    for (const Frame& frame : scene.train) {
      const Image image = read_grey(path_below(folder, frame.name + ".png").string());
      Mask mask(image.width, image.height);
      for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] = image.pixels[i] > 127;
      masks.emplace_back(frame.name, std::move(mask));
    }
  } catch (const Error&) {
    return {};
  }
  return masks;
}

std::vector<Rect> parts_around(const Scene& scene, const FrameStore& store,
                               const MotionMasks& masks) {
  std::map<std::string, const Mask*> by_name;
  for (const auto& [name, mask] : masks) by_name[name] = &mask;
  std::vector<Rect> parts;
  for (const Frame& frame : scene.train) {
    const Camera& camera = store.camera(frame);
    const auto found = by_name.find(frame.name);
    parts.push_back(found == by_name.end() ? Rect{0, 0, camera.width, camera.height}
                                           : region_around(resized(image_of(*found->second),
                                                                   camera.width, camera.height)));
  }
  return parts;
}

}  // namespace gflow
