// SPDX-License-Identifier: Apache-2.0
// Flow over several frames and point tracks as target flow of a training.
#include "optim/eval/evaluation.hpp"
#include "optim/formats/npz.hpp"
#include "optim/train/preparation.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class FarFlow : public ::testing::Test {
 protected:
  // A training as by `gflow train`, without a run folder; flow is never computed.
  struct Trained {
    Trained(Queue& queue, const TrainOptions& c, int steps)
        : config(c),
          prepared(config, ""),
          model(first(queue)),
          trainer(prepared.trainer(queue, model)) {
      for (int step = 0; step < steps; ++step) trainer.step(queue, step);
    }
    Model first(Queue& queue) {
      prepared.find_motion_masks();
      return Model(queue, prepared.first_model(queue));
    }
    TrainOptions config;
    Preparation prepared;
    Model model;
    Trainer trainer;
  };

  TrainOptions config(int reach) const {
    TrainOptions config = small_config(scene_, 600);
    config.density.enabled = false;
    config.flow.span = reach;
    config.flow.every = 1;  // the tests compare target flows, not their frequency
    return config;
  }
  // Flow error in the motion mask of the held-out view [px].
  double flow_error(const TrainOptions& config) {
    Trained trained(queue_, config, config.train.iterations);
    const LoadedScene& loaded = trained.prepared.loaded();
    return evaluate(queue_, trained.model, config, loaded, loaded.scene.test, {})
        .mean.flow_epe_dynamic;
  }
  Array::Values velocities(const TrainOptions& config) {
    Trained trained(queue_, config, 20);
    return trained.trainer.state(queue_).at("gaussians/velocities").values;
  }
  // Writes FOLDER/<camera>.npz with the tracks of the blob's Gaussians as each camera sees them.
  std::string write_tracks(const TemporaryFolder& folder) const {
    constexpr size_t points = 14, steps = SmallScene::steps;
    for (int c = 0; c < SmallScene::cameras; ++c) {
      const Camera camera = small_camera(c, 48, 40);
      std::vector<float> xy;
      for (size_t k = 0; k < steps; ++k)
        for (size_t i = 0; i < points; ++i) {
          const float* mean = &scene_.truth.groups.at("means")[3 * i];
          const double moved = blob_path * (double(k) / (steps - 1) - 0.5);
          const Eigen::Vector2d p = camera.project({mean[0] + moved, mean[1], mean[2]});
          xy.push_back(float(p.x()));
          xy.push_back(float(p.y()));
        }
      write_npz(folder.file(camera.name + ".npz"), {{"tracks", {{steps, points, 2}, xy}}});
    }
    return folder.path();
  }
  void expect_refused(const TrainOptions& config, std::initializer_list<std::string> words) {
    expect_error([&] { Preparation(config, ""); }, words);
  }

  Queue queue_ = test_queue();
  SmallScene scene_{queue_};
};

TEST_F(FarFlow, NeighboursOnlyIsTheDefaultAndOfOneReachTheShareMeansNothing) {
  TrainOptions near = config(1);
  const Array::Values expected = velocities(near);
  near.flow.long_share = 1;
  EXPECT_TRUE(velocities(near) == expected);
  EXPECT_FALSE(velocities(config(2)) == expected);
}

TEST_F(FarFlow, TeachesTheMotionByItself) {
  TrainOptions none = config(1), far = config(0);
  none.flow.weight = 0;
  far.flow.long_share = 1;  // over 2 and 4 frames, never between neighbours
  none.train.iterations = far.train.iterations = 1000;
  EXPECT_LT(flow_error(far), 0.5 * flow_error(none));
}

TEST_F(FarFlow, PathsOfPointsTeachTheMotion) {
  const TemporaryFolder folder;
  TrainOptions none = config(1), tracks = config(0);
  none.flow.weight = 0;
  tracks.flow.source = FlowSource::tracks;
  tracks.flow.tracks = write_tracks(folder);
  const double without = flow_error(none);
  EXPECT_LT(flow_error(tracks), 0.5 * without);
  tracks.flow.source = FlowSource::files;  // between neighbours; tracks over longer spans
  tracks.flow.long_span = gflow::FarFlow::tracks;
  EXPECT_LT(flow_error(tracks), 0.5 * without);
}

// Measured: 0.91 px without flow, 0.54 px with it in every third step, 0.36 px in each.
TEST_F(FarFlow, InEveryThirdStepOnlyItStillTeaches) {
  TrainOptions none = config(1), third = config(1);
  none.flow.weight = 0;
  third.flow.every = 3;
  EXPECT_LT(flow_error(third), 0.75 * flow_error(none));
}

TEST_F(FarFlow, WhatDoesNotGoTogetherIsRefused) {
  TrainOptions direct = config(2), in_time = config(2), nameless = config(1), empty = config(2);
  direct.flow.long_span = gflow::FarFlow::direct;
  expect_refused(direct, {"flow.long_span", "direct", "flow.source is \"files\""});
  in_time.flow.pairs = FlowPairs::time;
  expect_refused(in_time, {"flow.span", "flow.pairs"});
  nameless.flow.source = FlowSource::tracks;
  expect_refused(nameless, {"flow.tracks"});
  empty.flow.long_span = gflow::FarFlow::tracks;
  empty.flow.tracks = scene_.path() + "/nowhere";
  expect_refused(empty, {"nowhere/cam01.npz"});
}

}  // namespace
}  // namespace gflow
