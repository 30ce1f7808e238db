// SPDX-License-Identifier: Apache-2.0
// Training skips the work that its settings allow, counted on the device: skip.culled,
// skip.static_pose, skip.bands. trainer_test.cpp and bench_scene_test.cpp check that
// nothing else changes.
#include <gtest/gtest.h>

#include "optim/objectives/image_objective.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class LeftOutOfTraining : public testing::Test {
 protected:
  LeftOutOfTraining() : queue(test_queue()), scene(queue) {}
  Queue queue;
  SmallScene scene;
};

TEST_F(LeftOutOfTraining, TheShapesOfThoseOutsideTheImage) {
  TrainOptions config = small_config(scene, 20);
  const auto posed_and_drawn = [&](bool skip) {
    config.skip.culled = skip;
    SmallTraining training(queue, config);
    training.model.parameters["means"].values.fill_range(queue, 0, 3 * 20, 30.f);  // far
    std::array<size_t, 2> counts{};
    for (int step = 0; step < 10; ++step) {
      training.steps(queue, 1);
      const Renderer& renderer = training.trainer.renderer();
      for (float opacity : renderer.gaussians().opacities.read(queue)) counts[0] += opacity > 0;
      for (cl_uint tiles : renderer.engine().splats().tiles_touched.read(queue))
        counts[1] += tiles > 0;
    }
    return counts;
  };
  const auto some = posed_and_drawn(true), all = posed_and_drawn(false);
  EXPECT_EQ(some[1], all[1]);
  EXPECT_LT(some[0], all[0]);
  EXPECT_GE(some[0], some[1]);
}

// Every second Gaussian has a short lifetime.
void shorten_lives(Queue& queue, Parameters& p) {
  std::vector<float> scales = p["log_scales"].values.read(queue);
  std::vector<float> moments = p["means_t"].values.read(queue);
  for (size_t i = 0; i < moments.size(); i += 2) {
    scales[4 * i + 3] = std::log(0.1f);
    moments[i] = float(i % 7) / 6;
  }
  p["log_scales"].values.write(queue, scales);
  p["means_t"].values.write(queue, moments);
}

// A Gaussian that is not listed for a view does not affect it, and gradients of listed ones reach
// their own rows: parameters, optimiser, density control and static Gaussians, through several
// rounds.
TEST_F(LeftOutOfTraining, TheRowsOfOtherMomentsAndThisChangesNoBit) {
  const size_t there = scene.truth.count;
  const auto kinds = {MotionModelKind::spacetime, MotionModelKind::native4d,
                      MotionModelKind::keyframes};
  for (const bool with_static : {false, true})
    for (const MotionModelKind kind : kinds) {
      TrainOptions config = small_config(scene, 200);
      config.density.enabled = !with_static;  // which moves Gaussians that became static
      config.motion.model = choice_of(kind);
      config.motion.static_threshold = 1;
      config.motion.static_every = 60;
      config.density.every = 30;
      config.density.start = 20;
      config.flow.every = 1;
      size_t fewest = there, most_static = 0;
      const auto state_with = [&](bool skip) {
        config.skip.culled = skip;
        SmallTraining training(queue, config);
        Parameters& p = training.model.parameters;
        shorten_lives(queue, p);
        for (int step = 0; step < 80; ++step) {
          training.steps(queue, 1);
          const ViewRows& rows = training.trainer.renderer().rows();
          EXPECT_TRUE(skip || rows.count() == p.count || step % 30 == 29);
          if (skip) fewest = std::min(fewest, rows.count());
          most_static = std::max(most_static, p.count - p.moving);
        }
        return training.trainer.state(queue);
      };
      const Arrays listed = state_with(true), all = state_with(false);
      EXPECT_LT(fewest, 3 * there / 4) << name_of(kind);
      EXPECT_EQ(most_static > 0, with_static);
      ASSERT_EQ(listed.size(), all.size());
      for (const auto& [name, array] : listed)
        EXPECT_TRUE(array.values == all.at(name).values) << name_of(kind) << " " << name;
    }
}

// A motion loss identifies Gaussians by row and also compares those that the view does not show.
TEST_F(LeftOutOfTraining, NoRowsWhereAMotionLossComparesThem) {
  TrainOptions config = small_config(scene, 40);
  config.loss.rigidity = config.loss.velocity = 0.1f;
  config.loss.motion_every = 2;
  const auto state_with = [&](bool skip) {
    config.skip.culled = skip;
    SmallTraining training(queue, config);
    shorten_lives(queue, training.model.parameters);
    size_t fewest = training.model.parameters.count;
    for (int step = 0; step < 40; ++step) {
      training.steps(queue, 1);
      fewest = std::min(fewest, training.trainer.renderer().rows().count());
    }
    EXPECT_EQ(fewest < training.model.parameters.count, skip);
    return training.trainer.state(queue);
  };
  const Arrays listed = state_with(true), all = state_with(false);
  for (const auto& [name, array] : listed) EXPECT_TRUE(array.values == all.at(name).values) << name;
}

TEST_F(LeftOutOfTraining, TheSecondTimeOfStaticOnes) {
  TrainOptions config = small_config(scene, 200);
  config.density.enabled = false;
  config.motion.static_threshold = 1;
  config.motion.static_every = 60;
  config.flow.every = 1;
  for (const bool skip : {true, false}) {
    config.skip.static_pose = skip;
    SmallTraining training(queue, config);
    training.steps(queue, 70);
    const Parameters& p = training.model.parameters;
    ASSERT_LT(p.moving, p.count);
    const Renderer& renderer = training.trainer.renderer();
    for (int i = 0; i < 20 && !renderer.shot().flow; ++i) training.steps(queue, 1);
    ASSERT_TRUE(renderer.shot().flow);
    EXPECT_EQ(renderer.stood_still(), skip);
    EXPECT_EQ(renderer.shot().view.moving, skip ? renderer.rows().moving() : all_rows);
  }
}

// NaN in higher SH bands is not read while only degree 0 is in use.
TEST_F(LeftOutOfTraining, BandsOfColourThatAreNotInUseYet) {
  TrainOptions config = small_config(scene, 20);
  const auto drawn = [&](bool skip, bool broken) {
    config.skip.bands = skip;
    SmallTraining training(queue, config);
    EXPECT_EQ(training.trainer.sh_degree(0), 0);
    if (broken) training.model.parameters["sh_rest"].values.fill(queue, NAN);
    training.steps(queue, 1);
    return training.trainer.renderer().images().rgb.read(queue);
  };
  EXPECT_EQ(drawn(true, true), drawn(true, false));
  EXPECT_NE(drawn(false, true), drawn(false, false));
}

}  // namespace
}  // namespace gflow
