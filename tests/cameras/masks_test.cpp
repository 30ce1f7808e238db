// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/masks.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

Mask mask_of(const std::vector<std::string>& rows) {
  Mask mask(int(rows[0].size()), int(rows.size()));
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) mask.at(x, y) = rows[size_t(y)][size_t(x)] == '#';
  return mask;
}

TEST(Masks, SharesAreOfThePixelsInsideTheImage) {
  const Mask mask = mask_of({"#....", ".....", "...##", "...##"});
  EXPECT_EQ(dilated(mask, 1).pixels, mask_of({"##...", "#####", "..###", "..###"}).pixels);
  // Corners have 4 neighbours of which more than half must be set, edges 6, others 9.
  EXPECT_EQ(with_share_around(mask, 1, 0.5).pixels,
            mask_of({".....", ".....", "....#", "...##"}).pixels);
}

TEST(Masks, PartsTouchAtSidesNotAtCorners) {
  const Parts parts = parts_of(mask_of({"##..#", ".#.#.", ".#.##"}));
  EXPECT_EQ(parts.count, 3);
  EXPECT_EQ(parts.sizes, (std::vector<size_t>{4, 1, 3}));
  EXPECT_EQ(parts.labels, (std::vector<int>{1, 1, 0, 0, 2, 0, 1, 0, 3, 0, 0, 1, 0, 3, 3}));
}

}  // namespace
}  // namespace gflow
