// SPDX-License-Identifier: Apache-2.0
// Fixtures for tests of gflow's commands.
#pragma once
#include "optim/formats/npz.hpp"
#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {

// A scene and, on request, a run of three steps on it.
class CommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Queue queue = test_queue();
    scene_ = new SmallScene(queue);
    folder_ = new TemporaryFolder;
    trained_ = gflow({"train", scene_->path(), "-o", run(), "--iterations", "3", "--quiet"});
  }
  static void TearDownTestSuite() {
    delete scene_;
    delete folder_;
  }
  static std::string run() { return folder_->path() + "/run"; }
  static std::string model() { return run() + "/point_cloud/iteration_3/point_cloud.ply"; }
  static const SmallScene& scene() { return *scene_; }
  static const Outcome& trained() { return trained_; }

 private:
  inline static SmallScene* scene_ = nullptr;
  inline static TemporaryFolder* folder_ = nullptr;
  inline static Outcome trained_;
};

inline Array floats(std::vector<size_t> shape, std::vector<float> values) {
  return {std::move(shape), std::move(values)};
}
// Two Gaussians in front of a camera, for `gflow splat`.
inline Arrays small_npz() {
  return {{"means", floats({2, 3}, {0, 0, 2, 0.2f, 0, 3})},
          {"quats", floats({2, 4}, {1, 0, 0, 0, 1, 0, 0, 0})},
          {"scales", floats({2, 3}, std::vector<float>(6, 0.1f))},
          {"opacities", floats({2}, {0.5f, 0.5f})},
          {"colors", floats({2, 3}, {1, 0, 0, 0, 1, 0})},
          {"viewmat", floats({4, 4}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})},
          {"K", floats({3, 3}, {16, 0, 8, 0, 16, 6, 0, 0, 1})},
          {"size", Array{{2}, std::vector<int32_t>{16, 12}}}};
}

}  // namespace gflow
