// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/colmap_points.hpp"

#include <gtest/gtest.h>

using namespace gflow;

namespace {

std::vector<ColmapImage> images(const std::vector<std::string>& names) {
  std::vector<ColmapImage> list;
  for (const std::string& name : names) {
    list.push_back({name, {}});
    list.back().camera.name = name;
  }
  return list;
}

// "A=B ..." of the common cameras.
std::string common(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  const auto [first, second] = common_cameras(images(a), images(b));
  std::string pairs;
  for (size_t i = 0; i < first.size(); ++i) pairs += first[i].name + "=" + second[i].name + " ";
  return pairs;
}

}  // namespace

TEST(ColmapPoints, ImagesAreTheSameByTheirFileName) {
  EXPECT_EQ(common({"a.jpg", "b.jpg", "d.jpg"}, {"images/b.png", "x/a.png", "c"}),
            "a.jpg=x/a.png b.jpg=images/b.png ");
}

TEST(ColmapPoints, ImagesWithTheSameFileNameAreToldApartByTheirFolders) {
  EXPECT_EQ(common({"left/1.jpg", "right/1.jpg"}, {"images/right/1.jpg", "images/left/1.jpg"}),
            "left/1.jpg=images/left/1.jpg right/1.jpg=images/right/1.jpg ");
  EXPECT_EQ(common({"left/1.jpg", "right/1.jpg"}, {"right/1.jpg", "bright/1.jpg", "1.jpg"}),
            "left/1.jpg=1.jpg ");
  EXPECT_EQ(common({"1.jpg"}, {"left/1.jpg", "right/1.jpg"}), "");
}
