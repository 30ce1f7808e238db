// SPDX-License-Identifier: Apache-2.0
// The projection of one Gaussian against Eigen and against points projected by the camera; its
// derivative against central differences, inside the image and where J is clamped at the margin;
// culling.
#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "shared/projection.h"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;

PinholeCamera camera() { return random_scene({1, 64, 48}).shot.camera; }
Matrix3d rotation(const PinholeCamera& c) {
  return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(c.rotation).cast<double>();
}
Eigen::Vector2d pixel_of(const PinholeCamera& c, const Eigen::Vector3d& world) {
  const Eigen::Vector3d p =
      rotation(c) * world + Eigen::Map<const Eigen::Vector3f>(c.translation).cast<double>();
  return {double(c.fx) * p.x() / p.z() + double(c.cx), double(c.fy) * p.y() / p.z() + double(c.cy)};
}

TEST(Project, MeanIsWhereThePointIsSeen) {
  Random random(1);
  const PinholeCamera c = camera();
  for (int i = 0; i < 20; ++i) {
    const real3 mean = world_of(c, random.three() + make_real3(0, 0, 4));
    const Projection p = project(c, mean, random.nine());
    EXPECT_LT((eigen(p.mean) - pixel_of(c, eigen(mean))).norm(), 1e-10);
  }
}

// M = J W L: the derivative of the pixel along each column of L, by differences.
TEST(Project, FactorIsTheDerivativeOfThePixelByThePoint) {
  Random random(2);
  const PinholeCamera c = camera();
  for (int i = 0; i < 20; ++i) {
    const real3 mean = world_of(c, random.three() + make_real3(0, 0, 4));
    const Mat3 l = random.nine();
    const Projection p = project(c, mean, l);
    if (!p.u_inside || !p.v_inside) continue;
    const double h = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = h * eigen(l).col(k);
      const Eigen::Vector2d expected =
          (pixel_of(c, eigen(mean) + step) - pixel_of(c, eigen(mean) - step)) / (2 * h);
      EXPECT_LT((eigen(p.m).col(k) - expected).norm(), 1e-6);
    }
  }
}

TEST(Project, WhiteningIsTheTriangularRootOfTheInverseCovariance) {
  Random random(3);
  for (double size : {.01, 1., 30.})
    for (int i = 0; i < 20; ++i) {
      const Mat23 m = make_mat23(random.three() * size, random.three() * size);
      const Matrix2d s = eigen(m) * eigen(m).transpose() + double(DILATION) * Matrix2d::Identity();
      const Whitening w = whiten(m);
      const Matrix2d k = eigen(whitening_k(w)), u = eigen(whitening_u(w));
      EXPECT_LT((eigen(w.s) - s).norm(), 1e-12 * s.norm());
      EXPECT_NEAR(w.det / s.determinant(), 1, 1e-9);
      EXPECT_LT((k.transpose() * k * s - Matrix2d::Identity()).norm(), 1e-9);
      EXPECT_LT((k * u - Matrix2d::Identity()).norm(), 1e-12);
      EXPECT_EQ(k(1, 0), 0);
    }
}

// T5: the determinant of a needle of 1e4 x .01 px against the exact product of its axes.
TEST(Project, DeterminantOfANeedleKeepsItsDigits) {
  const double a = 1e4, b = .01, h = double(DILATION), angle = .3;
  const Mat23 m = make_mat23({a * std::cos(angle), -b * std::sin(angle), 0},
                             {a * std::sin(angle), b * std::cos(angle), 0});
  EXPECT_NEAR(whiten(m).det / ((a * a + h) * (b * b + h)), 1, 1e-14);
}

std::vector<double> flat(real3 mean, Mat3 l) {
  return {mean.x, mean.y, mean.z, l.r1.x, l.r1.y, l.r1.z,
          l.r2.x, l.r2.y, l.r2.z, l.r3.x, l.r3.y, l.r3.z};
}

// T24: at 0.9 of the width the axes are clamped; the factor 2 of unclamped ones would be wrong
// there.
TEST(Project, GradientEqualsCentralDifferencesInsideAndAtTheMargin) {
  Random random(4);
  const PinholeCamera c = camera();
  for (const real2 where : {real2{0, 0}, real2{.9, 0}, real2{0, -.9}, real2{-.9, .9}})
    for (int i = 0; i < 5; ++i) {
      const real3 mean = world_of(c, make_real3(where.x * 4, where.y * 4, 4) + random.three() * .1);
      const Mat3 l = random.nine();
      const real2 v_mean = random.two();
      const double v_depth = random();
      const Mat23 v_m = make_mat23(random.three(), random.three());
      const Projection o = project(c, mean, l);
      EXPECT_EQ(bool(o.u_inside), where.x == 0);
      EXPECT_EQ(bool(o.v_inside), where.y == 0);
      const auto loss = [&](const std::vector<double>& x) {
        const Projection p = project(
            c, {x[0], x[1], x[2]}, {{x[3], x[4], x[5]}, {x[6], x[7], x[8]}, {x[9], x[10], x[11]}});
        return dot(p.mean, v_mean) + p.p.z * v_depth + dot(p.m.r1, v_m.r1) + dot(p.m.r2, v_m.r2);
      };
      const GaussianGradient g = project_vjp(c, l, o, v_mean, v_depth, v_m);
      const std::vector<double> expected = numeric_gradient(loss, flat(mean, l));
      EXPECT_TRUE(all_close(flat(g.mean, g.factor), expected, {1e-6, 1e-6 * largest(expected)}));
    }
}

TEST(Project, GradientOfTheCovarianceEqualsCentralDifferences) {
  Random random(5);
  const Mat23 m = make_mat23(random.three(), random.three());
  const Sym2 v{random(), random(), random()};
  const auto loss = [&](const std::vector<double>& x) {
    return sym2_inner(whiten({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}}).s, v);
  };
  const Mat23 g = covariance_vjp(m, v);
  EXPECT_TRUE(all_close(std::vector<double>{g.r1.x, g.r1.y, g.r1.z, g.r2.x, g.r2.y, g.r2.z},
                        numeric_gradient(loss, {m.r1.x, m.r1.y, m.r1.z, m.r2.x, m.r2.y, m.r2.z}),
                        {1e-7, 1e-8}));
}

// ---- on the device: culling

// tiles_touched of Gaussians of 0.1 units at camera coordinates, with an identity camera.
std::vector<cl_uint> touched_at(Queue& queue, const std::vector<real3>& positions,
                                double opacity = .5) {
  PosedScene s;
  s.shot.camera = s.shot.camera_t2 = test_camera(64, 48);
  for (real3 p : positions) add_gaussian(s, p, {.1, .1, .1}, opacity);
  DeviceScene device(queue, s);
  device.forward();
  return device.engine.splats().tiles_touched.read(queue);
}

TEST(Project, DrawsFromTheNearPlaneOn) {  // T23; the near plane is at .01f
  Queue queue = test_queue();
  const double plane = double(.01f), above = double(std::nextafter(.01f, 1.f));
  const double below = double(std::nextafter(.01f, 0.f));
  const std::vector<cl_uint> touched = touched_at(queue, {{0, 0, -1},
                                                          {0, 0, -0.},
                                                          {0, 0, 0},
                                                          {0, 0, 1e-30},
                                                          {0, 0, below},
                                                          {0, 0, plane},
                                                          {0, 0, above},
                                                          {0, 0, 2}});
  for (int i = 0; i < 5; ++i) EXPECT_EQ(touched[i], 0u) << i;
  for (int i = 5; i < 8; ++i) EXPECT_GT(touched[i], 0u) << i;
}

TEST(Project, SkipsWhatIsFainterThanOneStepOf255) {
  Queue queue = test_queue();
  for (double opacity : {0., -1., 1e-30, .0039})
    EXPECT_EQ(touched_at(queue, {{0, 0, 2}}, opacity)[0], 0u);
  EXPECT_GT(touched_at(queue, {{0, 0, 2}}, .02)[0], 0u);
}

TEST(Project, SkipsWhatLiesBesideTheImage) {
  Queue queue = test_queue();
  EXPECT_EQ(touched_at(queue, {{5, 0, 2}, {0, -5, 2}, {-1e30, 0, 2}}),
            (std::vector<cl_uint>{0, 0, 0}));
}

}  // namespace
}  // namespace gflow
