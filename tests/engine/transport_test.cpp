// SPDX-License-Identifier: Apache-2.0
// The four transports against Eigen's eigenvectors and their definitions, at equal eigenvalues and
// for needles; derivatives against central differences; H on the device for small motion.
#include "shared/transport.h"

#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {
namespace {

using Eigen::Matrix2d;
const int MODES[] = {TRANSPORT_PAPER, TRANSPORT_OT, TRANSPORT_MATERIAL, TRANSPORT_TRANSLATE};

Mat23 random_factor(Random& random, double size) {
  return make_mat23(random.three() * size, random.three() * size);
}
// A splat of a x b px, rotated by `angle`.
Mat23 ellipse(double a, double b, double angle) {
  Eigen::Matrix<double, 2, 3> m;
  m << a * std::cos(angle), -b * std::sin(angle), .1, a * std::sin(angle), b * std::cos(angle), 0;
  return mat23_from(m);
}
Matrix2d covariance(Mat23 m) {
  return eigen(m) * eigen(m).transpose() + DILATION * Matrix2d::Identity();
}

// A from H = (A - I) U.
Matrix2d map_of(int mode, Mat23 m1, Mat23 m2) {
  const Whitening w = whiten(m1);
  return Matrix2d::Identity() + eigen(transport(mode, m1, w, m2)) * eigen(whitening_k(w));
}
// A by its definition, with eigenvectors.
Matrix2d expected_map(int mode, Mat23 m1, Mat23 m2) {
  const Matrix2d s1 = covariance(m1), s2 = covariance(m2), one = Matrix2d::Identity();
  const Matrix2d b1 = eigen_sqrt(s1), c1 = eigen_inverse_sqrt(s1);
  if (mode == TRANSPORT_PAPER) return eigen_sqrt(s2) * c1;
  if (mode == TRANSPORT_OT) return c1 * eigen_sqrt(b1 * s2 * b1) * c1;
  if (mode == TRANSPORT_MATERIAL)
    return one + (eigen(m2) - eigen(m1)) * eigen(m1).transpose() * s1.inverse();
  return one;
}

TEST(Transport, EveryMapIsItsDefinition) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Mat23 m1 = random_factor(random, 5), m2 = random_factor(random, 5);
    for (int mode : MODES) {
      const Matrix2d expected = expected_map(mode, m1, m2);
      EXPECT_LT((map_of(mode, m1, m2) - expected).norm(), 1e-10 * expected.norm()) << mode;
    }
  }
}

TEST(Transport, MapsOfNeedlesAreTheirDefinition) {
  // 300 x .3 px: kappa 1e5, where eigenvectors in double are accurate to 1e-10. Not for the Monge
  // map, whose B1 S2 B1 has kappa 1e10: it is checked by its defining property.
  for (double turn : {0., .01, 1.}) {
    const Mat23 m1 = ellipse(300, .3, .4), m2 = ellipse(290, .35, .4 + turn);
    const Matrix2d t = map_of(TRANSPORT_OT, m1, m2), s2 = covariance(m2);
    EXPECT_LT((t * covariance(m1) * t.transpose() - s2).norm(), 1e-9 * s2.norm());
    EXPECT_NEAR(t(0, 1), t(1, 0), 1e-9 * t.norm());
    for (int mode : {TRANSPORT_PAPER, TRANSPORT_MATERIAL, TRANSPORT_TRANSLATE}) {
      const Matrix2d expected = expected_map(mode, m1, m2);
      EXPECT_LT((map_of(mode, m1, m2) - expected).norm(), 1e-9 * expected.norm()) << mode;
    }
  }
}

TEST(Transport, RootIsEigensRoot) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const Mat23 m = random_factor(random, 3);
    const Whitening w = whiten(m);
    EXPECT_LT((eigen(root2(w.s, w.det).b) - eigen_sqrt(covariance(m))).norm(), 1e-12);
  }
}

TEST(Transport, LyapunovSolutionSolvesItsEquation) {
  Random random(3);
  const Sym2 b{2, .5, 1}, q{random(), random(), random()};
  const Matrix2d x = eigen(lyapunov2(b, b.a * b.c - b.b * b.b, q));
  EXPECT_LT((eigen(b) * x + x * eigen(b) - eigen(q)).norm(), 1e-14);
}

TEST(Transport, MongeMapIsSymmetricAndPushesTheFirstCovarianceToTheSecond) {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Mat23 m1 = random_factor(random, 5), m2 = random_factor(random, 5);
    const Matrix2d t = map_of(TRANSPORT_OT, m1, m2), s2 = covariance(m2);
    EXPECT_NEAR(t(0, 1), t(1, 0), 1e-11 * t.norm());
    EXPECT_LT((t * covariance(m1) * t.transpose() - s2).norm(), 1e-11 * s2.norm());
  }
}

TEST(Transport, PapersMapPushesTheFirstCovarianceToTheSecond) {
  Random random(5);
  const Mat23 m1 = random_factor(random, 5), m2 = random_factor(random, 5);
  const Matrix2d a = map_of(TRANSPORT_PAPER, m1, m2), s2 = covariance(m2);
  EXPECT_LT((a * covariance(m1) * a.transpose() - s2).norm(), 1e-12 * s2.norm());
}

TEST(Transport, MapsTurnWithTheImage) {
  Random random(6);
  Matrix2d turn;
  turn << 0, -1, 1, 0;
  for (int mode : MODES) {
    const Mat23 m1 = random_factor(random, 8), m2 = random_factor(random, 8);
    const Matrix2d turned =
        map_of(mode, mat23_from(turn * eigen(m1)), mat23_from(turn * eigen(m2)));
    EXPECT_LT((turned - turn * map_of(mode, m1, m2) * turn.transpose()).norm(), 1e-11) << mode;
  }
}

TEST(Transport, NothingMovedGivesExactlyNoFlow) {
  Random random(7);
  for (int mode : MODES) {
    const Mat23 m = random_factor(random, 5);
    const Mat2 h = transport(mode, m, whiten(m), m);
    EXPECT_TRUE(h.a == 0 && h.b == 0 && h.c == 0 && h.d == 0) << mode;
  }
}

// Gradient of sum_k v_k . (H K d_k) at fixed d_k by M1 and M2.
void expect_gradient(int mode, Mat23 m1, Mat23 m2, double step) {
  Random random(8);
  real2 d[4], v[4];
  for (int k = 0; k < 4; ++k) d[k] = random.two() * 2, v[k] = random.two();
  Mat2 gh = make_mat2(0, 0, 0, 0);
  const Matrix2d k1 = eigen(whitening_k(whiten(m1)));
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector2d z = k1 * eigen(d[k]);
    gh = make_mat2(gh.a + v[k].x * z.x(), gh.b + v[k].x * z.y(), gh.c + v[k].y * z.x(),
                   gh.d + v[k].y * z.y());
  }
  const auto flat = [](Mat23 a, Mat23 b) {
    return std::vector<double>{a.r1.x, a.r1.y, a.r1.z, a.r2.x, a.r2.y, a.r2.z,
                               b.r1.x, b.r1.y, b.r1.z, b.r2.x, b.r2.y, b.r2.z};
  };
  const auto loss = [&](const std::vector<double>& x) {
    const Mat23 a{{x[0], x[1], x[2]}, {x[3], x[4], x[5]}},
        b{{x[6], x[7], x[8]}, {x[9], x[10], x[11]}};
    const Whitening w = whiten(a);
    const Matrix2d map = eigen(transport(mode, a, w, b)) * eigen(whitening_k(w));
    double sum = 0;
    for (int k = 0; k < 4; ++k) sum += eigen(v[k]).dot(map * eigen(d[k]));
    return sum;
  };
  const TransportGradient g = transport_vjp(mode, m1, whiten(m1), m2, gh);
  const std::vector<double> expected = numeric_gradient(loss, flat(m1, m2), step);
  EXPECT_TRUE(all_close(flat(g.m1, g.m2), expected, {1e-6, 1e-6 * largest(expected) + 1e-12}))
      << mode;
}

TEST(Transport, GradientEqualsCentralDifferences) {
  Random random(9);
  for (int i = 0; i < 10; ++i)
    for (int mode : MODES)
      expect_gradient(mode, random_factor(random, 3), random_factor(random, 3), 1e-6);
}

TEST(Transport, GradientOfNeedlesEqualsCentralDifferences) {
  for (int mode : MODES) expect_gradient(mode, ellipse(60, .3, .4), ellipse(55, .4, .6), 1e-5);
}

// Eigenvectors are undefined here: both covariances are multiples of the identity.
TEST(Transport, GradientAtEqualEigenvaluesEqualsCentralDifferences) {
  Eigen::Matrix<double, 2, 3> round;
  round << 2, 0, 0, 0, 2, 0;
  for (double growth : {1., 1.5})
    for (int mode : MODES)
      expect_gradient(mode, mat23_from(round), mat23_from(growth * round), 1e-6);
}

Mat23 as_floats(Mat23 m) {
  const auto row = [](real3 r) { return make_real3(float(r.x), float(r.y), float(r.z)); };
  return {row(m.r1), row(m.r2)};
}

// T7, T10: on the device H is as accurate as floats allow, even for a needle that hardly moves,
// where computing A - I late would lose every digit. Rounding M once at both times changes H
// by 1.5e-5 here. M is rounded about thirty times on its way from quaternions and scales (6e-5 to
// 9e-5 with PoCL, 1.1e-4 on an H100).
TEST(Transport, DeviceFormsHOfNeedlesThatHardlyMove) {
  Queue queue = test_queue();
  for (Transport mode : {Transport::paper, Transport::ot, Transport::material}) {
    PosedScene s;
    s.shot.camera = s.shot.camera_t2 = test_camera(640, 480);
    s.shot.settings.transport = mode;
    Random random(10);
    for (int i = 0; i < 50; ++i) {
      add_gaussian(s, {random(), random(), 5}, {.3, .002, .01}, .5);
      for (int k = 0; k < 4; ++k) {
        const double q = double(float(random()));
        s.p["quats"][4 * i + k] = q;
        s.p["quats_t2"][4 * i + k] = double(float(q + 1e-3 * random()));
      }
      for (int k = 0; k < 3; ++k)
        s.p["scales_t2"][3 * i + k] =
            double(float(s.p["scales"][3 * i + k] * (1 + 1e-3 * random())));
    }
    DeviceScene device(queue, s, {true, false});
    device.forward();
    const std::vector<float> records = device.engine.splats().records.read(queue);
    const auto seen = reference::see(s.shot, reference::posed(s.p));
    std::vector<float> actual, rounded;
    std::vector<double> expected;
    for (int i = 0; i < 50; ++i) {
      const Mat23 m1 = seen[i].p.m, m2 = seen[i].p2.m;
      const Mat2 h = transport(int(mode), m1, seen[i].w, m2);
      for (double e : {h.a, h.b, h.c, h.d}) expected.push_back(e / double(SQRT_HALF_LOG2_E));
      for (int k = 12; k < 16; ++k) actual.push_back(records[16 * i + k]);
      const Mat23 f1 = as_floats(m1), f2 = as_floats(m2);
      const Mat2 r = transport(int(mode), f1, whiten(f1), f2);
      for (double e : {r.a, r.b, r.c, r.d}) rounded.push_back(float(e / double(SQRT_HALF_LOG2_E)));
    }
    const double once = relative_l2(rounded, expected);
    EXPECT_LT(once, 2e-5) << int(mode);
    EXPECT_LT(relative_l2(actual, expected), 8 * once) << int(mode);
  }
}

}  // namespace
}  // namespace gflow
