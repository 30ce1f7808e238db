// SPDX-License-Identifier: Apache-2.0
#include "optim/density/near_fade.hpp"

#include <gtest/gtest.h>

#include "optim/model/renderer.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

constexpr float kLogit = 2, kFaint = -5;

// Gaussians at x = 0 and depths along the axis of a camera at the origin that looks along z, with a
// near plane at 1 and an image of 100 x 100; the last three are beside its image, behind it, and in
// its housing.
const std::vector<std::array<float, 3>> kPlaces = {{0, 0, 0.5f}, {0, 0, 0.99f}, {0, 0, 1.01f},
                                                   {0, 0, 5},    {2, 0, 0.5f},  {0, 0, -0.5f},
                                                   {0, 0, 0.2f}};

PinholeCamera camera_at(double x) {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = camera.cx = camera.cy = 50;
  camera.viewmat(0, 3) = -x;
  return pinhole(camera, 1);
}

HostModel still_model() {
  HostModel model;
  model.shape.sh_degree = 0;
  for (const auto& [x, y, z] : kPlaces) {
    auto& g = model.groups;
    ++model.count;
    const auto put = [&](const char* name, std::initializer_list<float> values) {
      g[name].insert(g[name].end(), values);
    };
    put("means", {x, y, z});
    put("means_t", {0.5f});
    put("quats", {1, 0, 0, 0});
    put("log_scales", {-3, -3, -3, 5});
    put("logit_opacities", {kLogit});
    put("sh0", {0, 0, 0});
    g["sh_rest"];
  }
  set_static(model.shape, model.groups, model.count, 1);
  return model;
}

std::vector<float> faded(const std::vector<PinholeCamera>& cameras) {
  Queue queue = test_queue();
  Model model(queue, still_model());
  NearFade(queue).run(queue, model.parameters, *model.motion, 0.5f, cameras, kFaint);
  return model.parameters["logit_opacities"].values.read(queue);
}

TEST(NearFade, FadesWhatIsBetweenACameraAndItsNearPlane) {
  EXPECT_EQ(faded({camera_at(0)}),
            (std::vector<float>{kFaint, kFaint, kLogit, kLogit, kLogit, kLogit, kLogit}));
}

TEST(NearFade, AsksEveryCamera) {
  EXPECT_EQ(faded({camera_at(50), camera_at(2)}),
            (std::vector<float>{kLogit, kLogit, kLogit, kLogit, kFaint, kLogit, kLogit}));
  EXPECT_EQ(faded({}), std::vector<float>(kPlaces.size(), kLogit));
}

}  // namespace
}  // namespace gflow
