// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/mask_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "optim/scene/readers/reader_util.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr const char* mask_folders[] = {"masks", "mask", "Masks", "Mask"};

}  // namespace

std::string find_mask(const std::string& folder, const std::string& image,
                      const std::string& source) {
  for (const char* masks : mask_folders) {
    const fs::path path = path_inside(join(folder, masks), image, source);
    const auto beside = [&](const std::string& name) {
      return fs::path(path).replace_filename(name).string();
    };
    const std::string name = path.stem().string();
    for (const std::string& base : {path.string(), path.string() + ".mask", beside(name),
                                    beside(name + "_mask"), beside("mask_" + name)})
      if (const std::string found = find_image(base); !found.empty()) return found;
  }
  return "";
}

void report_unused_masks(const std::string& folder, const std::string& why, Scene& scene) {
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    if (std::any_of(split->begin(), split->end(),
                    [](const Frame& frame) { return !frame.mask_path.empty(); }))
      return;
  for (const char* masks : mask_folders)
    if (!list_images_below(join(folder, masks)).empty())
      scene.notices.push_back(
          fmt::format("masks in {} are not used: {}", join(folder, masks), why));
}

}  // namespace gflow
