// SPDX-License-Identifier: Apache-2.0
// Quaternions against Eigen, their derivatives against central differences, and edge cases.
#include "shared/quat.h"

#include <gtest/gtest.h>

#include "tests/support/compare.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {
namespace {

std::vector<double> flat(real4 q) { return {q.x, q.y, q.z, q.w}; }
double inner(Mat3 a, Mat3 b) { return dot(a.r1, b.r1) + dot(a.r2, b.r2) + dot(a.r3, b.r3); }

TEST(Quat, RotationMatrixIsEigens) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const real4 q = random.four();
    const Eigen::Matrix3d expected = eigen_quat(q).normalized().toRotationMatrix();
    EXPECT_LT((eigen(quat_to_rotmat(quat_normalize(q).q)) - expected).norm(), 1e-14);
  }
}

TEST(Quat, ProductIsEigens) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const real4 a = random.four(), b = random.four();
    const Eigen::Quaterniond e = eigen_quat(a) * eigen_quat(b);
    EXPECT_TRUE(all_close(flat(quat_mul(a, b)), std::vector<double>{e.w(), e.x(), e.y(), e.z()},
                          {1e-15, 1e-15}));
  }
}

TEST(Quat, NormalizingSurvivesAnyLength) {
  const real4 q{.5, -.5, .1, .7};
  const double length = std::sqrt(dot(q, q));
  for (double size : {1e-4, 1., 2e19, 1e30})
    EXPECT_TRUE(all_close(flat(quat_normalize(q * size).q), flat(q * (1 / length)), {1e-14, 0}));
}

TEST(Quat, TooShortOrNotFiniteMeansNoRotationAndNoGradient) {
  const double nan = std::nan(""), inf = HUGE_VAL;
  for (const real4 q :
       {real4{0, 0, 0, 0}, real4{1e-30, 0, 0, 1e-19}, real4{nan, 1, 0, 0}, real4{1, 0, inf, 0}}) {
    const UnitQuat u = quat_normalize(q);
    EXPECT_EQ(flat(u.q), (std::vector<double>{1, 0, 0, 0}));
    EXPECT_EQ(flat(quat_normalize_vjp(u, {1, 2, 3, 4})), (std::vector<double>{0, 0, 0, 0}));
  }
}

TEST(Quat, GradientOfTheUnitQuaternionEqualsCentralDifferences) {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    const real4 q = random.four(), v = random.four();
    const auto loss = [&](const std::vector<double>& x) {
      return dot(quat_normalize({x[0], x[1], x[2], x[3]}).q, v);
    };
    EXPECT_TRUE(all_close(flat(quat_normalize_vjp(quat_normalize(q), v)),
                          numeric_gradient(loss, flat(q)), {1e-7, 1e-7}));
  }
}

TEST(Quat, GradientOfTheRotationEqualsCentralDifferences) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    const real4 q = random.four();
    const Mat3 v = random.nine();
    const auto loss = [&](const std::vector<double>& x) {
      return inner(quat_to_rotmat({x[0], x[1], x[2], x[3]}), v);
    };
    EXPECT_TRUE(
        all_close(flat(quat_to_rotmat_vjp(q, v)), numeric_gradient(loss, flat(q)), {1e-8, 1e-8}));
  }
}

TEST(Quat, FactorIsTheRootOfEigensCovariance) {
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const real4 q = random.four();
    const real3 s = random.three() + make_real3(1.5, 1.5, 1.5);
    const Eigen::Matrix3d r = eigen_quat(q).normalized().toRotationMatrix();
    const Eigen::Matrix3d expected = r * eigen(s).cwiseAbs2().asDiagonal() * r.transpose();
    const Eigen::Matrix3d l = eigen(factor_of(q, s));
    EXPECT_LT((l * l.transpose() - expected).norm(), 1e-13);
  }
}

TEST(Quat, GradientOfTheFactorEqualsCentralDifferences) {
  Random random(6);
  for (int i = 0; i < 20; ++i) {
    const real4 q = random.four();
    const real3 s = random.three();
    const Mat3 v = random.nine();
    const FactorGradient actual = factor_of_vjp(q, s, v);
    const auto loss = [&](const std::vector<double>& x) {
      return inner(factor_of({x[0], x[1], x[2], x[3]}, {x[4], x[5], x[6]}), v);
    };
    const std::vector<double> flat_actual{actual.quat.x,  actual.quat.y,   actual.quat.z,
                                          actual.quat.w,  actual.scales.x, actual.scales.y,
                                          actual.scales.z};
    EXPECT_TRUE(all_close(flat_actual, numeric_gradient(loss, {q.x, q.y, q.z, q.w, s.x, s.y, s.z}),
                          {1e-7, 1e-7}));
  }
}

}  // namespace
}  // namespace gflow
