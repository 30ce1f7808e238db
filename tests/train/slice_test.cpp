// SPDX-License-Identifier: Apache-2.0
// A slice is right when it looks like the model at its time, also from a file.
#include "optim/train/slice.hpp"

#include <Eigen/Dense>
#include <random>

#include "optim/loss/metrics.hpp"
#include "optim/train/views.hpp"
#include "train/small_scene.hpp"

namespace gflow {
namespace {

TEST(Slice, FactorsComeBackFromTheirParts) {
  std::mt19937 rng(2);
  for (int round = 0; round < 50; ++round) {
    Eigen::Matrix<float, 3, 3, Eigen::RowMajor> l;
    for (long k = 0; k < 9; ++k) l.data()[k] = float(rng()) / 4294967296.f - 0.5f;
    if (round % 3 == 0) l.row(1) = 2 * l.row(0);      // flat
    if (round % 4 == 0) l = (1e-4f * l).eval();       // small
    if (round % 5 == 0) l.col(2) = 1e-6f * l.col(2);  // nearly flat
    const FactorParts parts = parts_of_factor(l.data());
    const Eigen::Quaterniond q(parts.quat[0], parts.quat[1], parts.quat[2], parts.quat[3]);
    EXPECT_NEAR(q.norm(), 1, 1e-12);
    const Eigen::Matrix3d rs =
        q.toRotationMatrix() *
        Eigen::Vector3d(parts.scales[0], parts.scales[1], parts.scales[2]).asDiagonal();
    const Eigen::Matrix3d expected = l.cast<double>() * l.cast<double>().transpose();
    EXPECT_LT((rs * rs.transpose() - expected).norm(), 1e-12 * expected.norm());
  }
}

// 60 Gaussians of all shapes that move, turn, come and go.
HostModel lively_model(MotionModelKind kind) {
  HostModel model;
  model.shape.motion = kind;
  model.shape.sh_degree = 1;
  model.shape.duration = 2;
  model.shape.keys = 4;
  model.shape.bases = 3;
  for (uint i = 0; i < 60; ++i)
    append_gaussian(model, {noise(20, i), noise(21, i), 0.5f * noise(22, i)}, 0.1f, some_color(i),
                    0);
  for (const char* name : {"velocities", "half_accelerations", "turns"}) model.groups.erase(name);
  auto& g = model.groups;
  for (uint i = 0; i < 60; ++i) {
    g["means_t"][i] = 1 + noise(23, i);
    for (uint k = 0; k < 4; ++k) g["quats"][4 * i + k] += 0.9f * noise(24 + k, i);
    for (uint k = 0; k < 3; ++k) g["log_scales"][4 * i + k] = -2.3f + 0.8f * noise(28 + k, i);
    g["log_scales"][4 * i + 3] = noise(31, i) - 1;
    g["logit_opacities"][i] = 2 * noise(32, i);
    for (uint k = 0; k < 9; ++k) g["sh_rest"].push_back(0.3f * noise(33 + k, i));
  }
  add_rest(model.shape, g, 60);
  for (const MotionColumns& columns : motion_columns(model.shape))
    for (size_t k = 0; k < g[columns.group].size(); ++k)
      g[columns.group][k] += 0.4f * noise(50, uint(k));
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups)
      for (size_t k = 0; k < g[group.name].size(); ++k)
        g[group.name][k] += 0.1f * noise(51, uint(k));
  return model;
}

std::vector<float> drawn(Queue& queue, const HostModel& host, double time, const Camera& camera) {
  Renderer renderer(queue, {});
  Model model(queue, host);
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
  shot.time = time;
  renderer.forward(queue, model, shot);
  return renderer.images().rgb.read(queue);
}

class EverySlicedModel : public testing::TestWithParam<MotionModelKind> {};

TEST_P(EverySlicedModel, LooksFromAFileLikeTheModelAtItsTime) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  const HostModel host = lively_model(GetParam());
  Model model(queue, host);
  const Camera camera = orbit_views(host, {0}, "-y")[0].camera;
  std::vector<float> before;
  for (const double time : {0.0, 0.4, 1.0}) {
    const SplatTable sliced = slice(queue, model, time);
    EXPECT_GT(sliced.table.rows, 5u);
    EXPECT_LT(sliced.table.rows, host.count);  // some are not there
    write_ply(folder.file("slice.ply"), sliced.table);
    const HostModel back = read_model(folder.file("slice.ply"));
    EXPECT_TRUE(stands_still(back));
    const std::vector<float> expected = drawn(queue, host, time, camera);
    const std::vector<float> got = drawn(queue, back, 0, camera);
    EXPECT_GT(psnr(Picture::from_planes(camera.width, camera.height, got),
                   Picture::from_planes(camera.width, camera.height, expected)),
              80);  // float32; a logit less at opacities of nearly 1
    EXPECT_NE(expected, before);
    before = expected;
  }
}
INSTANTIATE_TEST_SUITE_P(All, EverySlicedModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases),
                         [](const auto& test) {
                           return std::string(names_of(test.param)[size_t(test.param)]);
                         });

}  // namespace
}  // namespace gflow
