// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/true_depth.hpp"

#include "optim/formats/npy.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

Frame with_depth(const std::string& path) {
  Frame frame;
  frame.name = "cam00_0000";
  frame.depth_path = path;
  return frame;
}

TEST(TrueDepth, IsThatOfTheFileOrItsNearestSample) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.npy");
  std::vector<float> values;
  for (int i = 0; i < 24; ++i) values.push_back(float(i));
  write_npy(path, {{4, 6}, values});
  EXPECT_EQ(read_true_depth(with_depth(path), 6, 4), values);
  // The centre of a pixel twice as large is between four pixels; the last of these is used.
  EXPECT_EQ(read_true_depth(with_depth(path), 3, 2), (std::vector<float>{7, 9, 11, 19, 21, 23}));
}

TEST(TrueDepth, OfAnotherShapeIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.npy"), flat = folder.file("flat.npy");
  write_npy(path, {{4, 6}, std::vector<float>(24, 1.f)});
  write_npy(flat, {{24}, std::vector<float>(24, 1.f)});
  expect_error([&] { read_true_depth(with_depth(path), 6, 6); }, {path, "6x4", "6x6"});
  expect_error([&] { read_true_depth(with_depth(flat), 6, 4); },
               {flat, "(24,)", "(height, width)"});
  expect_error([&] { read_true_depth(with_depth(""), 6, 4); }, {"cam00_0000", "no true depth"});
  expect_error([&] { read_true_depth(with_depth("no/such.npy"), 6, 4); }, {"no/such.npy"});
}

}  // namespace
}  // namespace gflow
