// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/follow_paths.hpp"

#include <gtest/gtest.h>

#include "optim/init/init.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

// A cloud of points that moves along a bend and turns about the vertical.
Paths bent_paths() {
  Paths paths;
  constexpr size_t frames = 21;
  for (size_t k = 0; k < frames; ++k) paths.times.push_back(double(k) / (frames - 1));
  for (size_t i = 0; i < 200; ++i) {
    const double a = 2.4 * double(i), r = 0.02 * double(i % 17), h = 0.03 * double(i % 11);
    for (const double t : paths.times) {
      const double angle = a + 1.2 * (t - 0.5);
      for (const double x :
           {r * std::cos(angle) + 1.5 * (t - 0.5), r * std::sin(angle) + std::cos(3 * t), h})
        paths.xyz.push_back(float(x));
      paths.seen.push_back(1);
    }
    paths.first_seen.push_back(int(i % frames));
    paths.size.push_back(0.05f);
  }
  paths.rgb.assign(3 * paths.count(), 128);
  return paths;
}

HostModel model_on(const Paths& paths, MotionModelKind kind, size_t frame) {
  HostModel model;
  MotionOptions options;
  static_cast<MotionShape&>(model.shape) = motion_shape(kind, options, int(paths.frames()));
  model.shape.duration = 8;
  model.shape.sh_degree = 0;
  model.count = paths.count();
  HostGroups& g = model.groups;
  for (size_t i = 0; i < model.count; ++i) {
    g["means"].insert(g["means"].end(), paths.at(i, frame), paths.at(i, frame) + 3);
    g["quats"].insert(g["quats"].end(), {1, 0, 0, 0});
    g["log_scales"].insert(g["log_scales"].end(), {-3, -3, -3, 9});
  }
  g["means_t"].assign(model.count, 4), g["logit_opacities"].assign(model.count, 0);
  g["sh0"].assign(3 * model.count, 0), g["sh_rest"];
  enclose(model.shape, g["means"], options);
  set_static(model.shape, g, model.count, 1);
  if (const auto place = motion_model_of(kind).place) place(model.shape, g, 0, model.count);
  return model;
}

TEST(FollowPaths, AFieldLearnsWhereGaussiansAreAtEachTime) {
  const Paths paths = bent_paths();
  Scene scene;
  scene.extent = 1;
  for (const MotionModelKind kind : {MotionModelKind::nodes, MotionModelKind::hexplane}) {
    Queue queue = test_queue();
    HostModel host = model_on(paths, kind, paths.frames() / 2);
    follow_paths(queue, host, paths, scene, {});
    Model model(queue, host);
    double squared = 0, moved = 0;
    for (size_t k = 0; k < paths.frames(); ++k) {
      GaussiansAt at;
      model.motion->at(queue, model.parameters, model.time(paths.times[k]), nullptr, at);
      const std::vector<float> means = at.means.read(queue);
      for (size_t i = 0; i < paths.count(); ++i)
        for (size_t c = 0; c < 3; ++c) {
          squared += std::pow(double(means[3 * i + c] - paths.at(i, k)[c]), 2);
          moved += std::pow(double(paths.at(i, 10)[c] - paths.at(i, k)[c]), 2);
        }
    }
    EXPECT_LT(std::sqrt(squared / moved), 0.05) << name_of(kind);
  }
}

TEST(FollowPaths, GaussiansWithTheirOwnMotionTakeThePathsVelocities) {
  const Paths paths = bent_paths();
  Queue queue = test_queue();
  HostModel host = model_on(paths, MotionModelKind::spacetime, 10);
  follow_paths(queue, host, paths, {}, {});
  for (size_t i = 0; i < paths.count(); ++i) {
    const size_t k = size_t(paths.first_seen[i]), before = k - (k > 0),
                 after = std::min<size_t>(k + 1, 20);
    for (size_t c = 0; c < 3; ++c) {
      const double apart = double(after - before) / 20 * 8;
      EXPECT_NEAR(double(host.groups.at("velocities")[3 * i + c]),
                  double(paths.at(i, after)[c] - paths.at(i, before)[c]) / apart, 1e-5);
    }
  }
}

}  // namespace
}  // namespace gflow
