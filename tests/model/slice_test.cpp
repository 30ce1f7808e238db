// SPDX-License-Identifier: Apache-2.0
// A slice must render like the model at its time, also when read from a file.
#include "optim/model/slice.hpp"

#include <Eigen/Dense>
#include <random>

#include "optim/eval/views.hpp"
#include "optim/loss/metrics.hpp"
#include "tests/support/lively_model.hpp"

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

// Such a Gaussian is not rendered, and no file could represent it.
TEST(Slice, LeavesOutScalesThatNoFloatHolds) {
  Queue queue = test_queue();
  HostModel host = lively_model(MotionModelKind::spacetime);
  const size_t whole = [&] {
    Model model(queue, host);
    return slice(queue, model, 0.4).table.rows;
  }();
  for (float* scale = &host.groups["log_scales"][0]; scale < &host.groups["log_scales"][12];
       scale += 4)
    *scale = 89;  // one of the first three
  Model model(queue, host);
  const SplatTable sliced = slice(queue, model, 0.4);
  EXPECT_LT(sliced.table.rows, whole);
  EXPECT_GE(sliced.table.rows, whole - 3);
  for (const float value : sliced.table.values) EXPECT_TRUE(std::isfinite(value));
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
    EXPECT_LT(sliced.table.rows, host.count);  // some do not exist at that time
    write_ply(folder.file("slice.ply"), sliced.table);
    const HostModel back = read_model(folder.file("slice.ply"));
    EXPECT_TRUE(is_static_model(back));
    const std::vector<float> expected = drawn(queue, host, time, camera);
    const std::vector<float> got = drawn(queue, back, 0, camera);
    EXPECT_GT(psnr(PlanarImage::from_planes(camera.width, camera.height, got),
                   PlanarImage::from_planes(camera.width, camera.height, expected)),
              80);  // float32; less precise for a logit of an opacity near 1
    EXPECT_NE(expected, before);
    before = expected;
  }
}
INSTANTIATE_TEST_SUITE_P(All, EverySlicedModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace gflow
