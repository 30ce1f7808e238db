// SPDX-License-Identifier: Apache-2.0
#include "optim/density/hidden.hpp"

#include <gtest/gtest.h>

#include "optim/model/renderer.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

constexpr float kLogit = 0, kFaint = -5;  // opacity .5

struct Ball {
  float x, z, radius, logit;
};

HostModel model_of(const std::vector<Ball>& balls) {
  HostModel model;
  model.shape.sh_degree = 0;
  for (const Ball& ball : balls) {
    auto& g = model.groups;
    ++model.count;
    const auto put = [&](const char* name, std::initializer_list<float> values) {
      g[name].insert(g[name].end(), values);
    };
    const float size = std::log(ball.radius);
    put("means", {ball.x, 0, ball.z});
    put("means_t", {0.5f});
    put("quats", {1, 0, 0, 0});
    put("log_scales", {size, size, size, 5});
    put("logit_opacities", {ball.logit});
    put("sh0", {0, 0, 0});
    g["sh_rest"];
  }
  set_static(model.shape, model.groups, model.count, 1);
  return model;
}

// From x along z; 50 px per unit at depth 1.
Shot shot_from(double x) {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = camera.cx = camera.cy = 50;
  camera.viewmat(0, 3) = -x;
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.1f);
  shot.time = shot.time_t2 = 0.5;
  shot.sh_degree = 0;
  return shot;
}

// Which of them were not shown to the share `least` by any camera.
std::vector<bool> hidden(const std::vector<Ball>& balls, const std::vector<double>& cameras,
                         float least = 0.2f, bool all_views = true) {
  Queue queue = test_queue();
  Model model(queue, model_of(balls));
  Renderer renderer(queue, {});
  Hidden hidden(queue);
  ImageGradients v;
  hidden.begin(queue, model.parameters, all_views);
  for (const double x : cameras) {
    renderer.forward(queue, model, shot_from(x));
    v.zero(queue, renderer.images(), false, false);
    v.v_rgb.fill(queue, 1.f);
    renderer.backward_to_poses(queue, v);
    hidden.see(queue, model.parameters, renderer.rows().list(), renderer.shot().view.camera,
               renderer.engine().splats(), renderer.gradients());
  }
  hidden.fade(queue, model.parameters, least, kFaint);
  std::vector<bool> result;
  for (const float logit : model.parameters["logit_opacities"].values.read(queue))
    result.push_back(logit == kFaint);
  return result;
}

// An opaque ball, one behind it, and one beside it.
const std::vector<Ball> kBehind = {{0, 5, 1, 8}, {0, 8, .2f, kLogit}, {4, 8, .2f, kLogit}};

TEST(Hidden, FindsWhatIsBehindAnotherForEveryCamera) {
  EXPECT_EQ(hidden(kBehind, {0}), (std::vector<bool>{false, true, false}));
  EXPECT_EQ(hidden(kBehind, {0, 4}), (std::vector<bool>{false, false, false}));
}

TEST(Hidden, WhatNoCameraDrawsIsHidden) {
  EXPECT_EQ(hidden(kBehind, {}), std::vector<bool>(3, true));
  EXPECT_EQ(hidden(kBehind, {100}), std::vector<bool>(3, true));
}

TEST(Hidden, WhereViewsAreLeftOutWhatIsOutsideTheOthersStays) {
  EXPECT_EQ(hidden(kBehind, {0}, 0.2f, false), (std::vector<bool>{false, true, false}));
  EXPECT_EQ(hidden(kBehind, {100}, 0.2f, false), std::vector<bool>(3, false));
}

// Its opacity is .5, so what is behind its centre is shown by half.
TEST(Hidden, SharesAreThoseThatWhatIsInFrontLetsThrough) {
  const std::vector<Ball> balls = {{0, 5, 1, kLogit}, {0, 8, .05f, kLogit}};
  EXPECT_EQ(hidden(balls, {0}, .48f), (std::vector<bool>{false, false}));
  EXPECT_EQ(hidden(balls, {0}, .52f), (std::vector<bool>{false, true}));
}

// An alpha below 1/255 is not drawn: of opacity .5 one part in 130, so it is shown by .992.
TEST(Hidden, AGaussianAloneIsShownWhole) {
  const std::vector<Ball> balls = {{0, 5, 1, kLogit}};
  EXPECT_EQ(hidden(balls, {0}, .99f), (std::vector<bool>{false}));
  EXPECT_EQ(hidden(balls, {0}, .995f), (std::vector<bool>{true}));
}

// Its centre is one pixel outside the image.
TEST(Hidden, WhatTheImageCutsOffCountsAsShown) {
  const std::vector<Ball> balls = {{5.1f, 5, .5f, kLogit}};
  EXPECT_EQ(hidden(balls, {0}, .99f), (std::vector<bool>{false}));
}

}  // namespace
}  // namespace gflow
