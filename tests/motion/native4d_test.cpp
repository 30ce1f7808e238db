// SPDX-License-Identifier: Apache-2.0
// The slice of a 4D Gaussian against the conditional distribution that Eigen computes from its 4x4
// covariance; its derivative against central differences; the device against the double formulas.
#include "optim/motion/native4d.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

Native4d random_native4d(Random& random) {
  Native4d g;
  g.mean = random.three();
  g.mean_t = random();
  g.quat = random.four();
  g.quat_r = random.four();
  g.log_scales = random.four();
  g.logit_opacity = 3 * random();
  return g;
}

// R of R v = ql v conj(qr), v = (x, y, z, t) read as t + xi + yj + zk, one column per axis.
Eigen::Matrix4d rotation4(const Native4d& g) {
  const Eigen::Quaterniond ql = eigen_quat(g.quat).normalized();
  const Eigen::Quaterniond qr = eigen_quat(g.quat_r).normalized();
  Eigen::Matrix4d r;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Quaterniond axis(k == 3, k == 0, k == 1, k == 2);
    r.col(k) = (ql * axis * qr.conjugate()).coeffs();  // x y z w
  }
  return r;
}

TEST(Native4d, CutIsTheConditionalDistributionAtThatTime) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Native4d g = random_native4d(random);
    const double t = random();
    const Eigen::Matrix4d r = rotation4(g);
    EXPECT_LT((r * r.transpose() - Eigen::Matrix4d::Identity()).norm(), 1e-14);
    const Eigen::Matrix4d s =
        r * (2 * eigen(g.log_scales)).array().exp().matrix().asDiagonal() * r.transpose();
    const Eigen::Vector3d st = s.block<3, 1>(0, 3);
    const double var = s(3, 3), dt = t - g.mean_t;
    const Eigen::Matrix3d schur = s.block<3, 3>(0, 0) - st * st.transpose() / var;
    const Slice cut = slice_at(g, t);
    const Eigen::Matrix3d l = eigen(cut.factor);
    EXPECT_LT((l * l.transpose() - schur).norm(), 1e-12 * s.norm());
    EXPECT_LT((eigen(cut.mean) - (eigen(g.mean) + st * dt / var)).norm(), 1e-12);
    EXPECT_NEAR(cut.life.opacity, std::exp(-.5 * dt * dt / var) / (1 + std::exp(-g.logit_opacity)),
                1e-13);
  }
}

TEST(Native4d, EqualQuaternionsTurnSpaceOnlyAndNothingMoves) {
  Random random(2);
  Native4d g = random_native4d(random);
  g.quat_r = g.quat;
  const Slice cut = slice_at(g, g.mean_t + .7);
  EXPECT_LT((eigen(cut.mean) - eigen(g.mean)).norm(), 1e-14);
  const real3 scales{std::exp(g.log_scales.x), std::exp(g.log_scales.y), std::exp(g.log_scales.z)};
  const Eigen::Matrix3d l = eigen(cut.factor), expected = eigen(factor_of(g.quat, scales));
  EXPECT_LT((l * l.transpose() - expected * expected.transpose()).norm(), 1e-13);
}

std::vector<double> flat(const Native4d& g) {
  return {g.mean.x,       g.mean.y,       g.mean.z,       g.mean_t,       g.quat.x,
          g.quat.y,       g.quat.z,       g.quat.w,       g.quat_r.x,     g.quat_r.y,
          g.quat_r.z,     g.quat_r.w,     g.log_scales.x, g.log_scales.y, g.log_scales.z,
          g.log_scales.w, g.logit_opacity};
}
Native4d from_flat(const std::vector<double>& x) {
  Native4d g;
  g.mean = {x[0], x[1], x[2]};
  g.mean_t = x[3];
  g.quat = {x[4], x[5], x[6], x[7]};
  g.quat_r = {x[8], x[9], x[10], x[11]};
  g.log_scales = {x[12], x[13], x[14], x[15]};
  g.logit_opacity = x[16];
  return g;
}

TEST(Native4d, GradientEqualsCentralDifferences) {
  Random random(3);
  for (int i = 0; i < 30; ++i) {
    const Native4d g = random_native4d(random);
    const double t = g.mean_t + .5 * random(), v_opacity = random();
    const real3 v_mean = random.three();
    const Mat3 v_l = random.nine();
    const auto loss = [&](const std::vector<double>& x) {
      const Slice o = slice_at(from_flat(x), t);
      return dot(o.mean, v_mean) + o.life.opacity * v_opacity + dot(o.factor.r1, v_l.r1) +
             dot(o.factor.r2, v_l.r2) + dot(o.factor.r3, v_l.r3);
    };
    const std::vector<double> expected = numeric_gradient(loss, flat(g));
    EXPECT_TRUE(all_close(flat(slice_vjp(g, t, v_mean, v_l, v_opacity)), expected,
                          {1e-6, 1e-6 * largest(expected)}));
  }
}

TEST(Native4d, OpacityGradientIsExactForSaturatedLogits) {
  Random random(4);
  Native4d g = random_native4d(random);
  for (double x : {-80., -20., 20., 80.}) {
    g.logit_opacity = x;
    const Native4d v = slice_vjp(g, g.mean_t, {0, 0, 0}, {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}, 1);
    const double e = std::exp(-std::fabs(x));
    EXPECT_NEAR(v.logit_opacity / (e / ((1 + e) * (1 + e))), 1, 1e-12) << x;
  }
}

// ---- on the device

constexpr size_t N_NATIVE4D = 37;

struct Native4dModel {
  Parameters p;
  reference::Named values;
};
Native4dModel random_model(Queue& queue, const Native4dMotion& motion) {
  Native4dModel m{Parameters(queue, N_NATIVE4D, motion.groups()), {}};
  Random random(5);
  for (size_t i = 0; i < N_NATIVE4D; ++i) {
    const Native4d g = random_native4d(random);
    append(m.values, "means", {g.mean.x, g.mean.y, g.mean.z});
    append(m.values, "means_t", {g.mean_t});
    append(m.values, "quats", {g.quat.x, g.quat.y, g.quat.z, g.quat.w});
    append(m.values, "quats_r", {g.quat_r.x, g.quat_r.y, g.quat_r.z, g.quat_r.w});
    append(m.values, "log_scales",
           {g.log_scales.x, g.log_scales.y, g.log_scales.z, g.log_scales.w});
    append(m.values, "logit_opacities", {g.logit_opacity});
  }
  for (const auto& [name, values] : m.values) m.p[name].values.write(queue, to_float(values));
  m.p.rows.seen.fill(queue, 0);
  return m;
}

TEST(Native4d, DeviceCutsAsTheDoubleFormulas) {
  Queue queue = test_queue();
  Native4dMotion motion(queue, .5f);
  Native4dModel m = random_model(queue, motion);
  GaussiansAt windowed, whole;
  const Buffer<cl_uint> all(queue, std::vector<cl_uint>(N_NATIVE4D, 1u), "seen");
  motion.at(queue, m.p, .25f, nullptr, windowed);
  motion.at(queue, m.p, .25f, &all, whole);
  std::vector<double> means, factors, opacities;
  for (size_t i = 0; i < N_NATIVE4D; ++i) {
    const Slice s = slice_at(reference::native4d_row(m.values, i), .25);
    for (double x : {s.mean.x, s.mean.y, s.mean.z}) means.push_back(x);
    for (real3 r : {s.factor.r1, s.factor.r2, s.factor.r3})
      for (double x : {r.x, r.y, r.z}) factors.push_back(x);
    opacities.push_back(s.life.marginal > .5 ? s.life.opacity : 0);
  }
  EXPECT_TRUE(all_close(whole.means.read(queue), means, FLOAT_MATHS));
  EXPECT_TRUE(all_close(whole.factors.read(queue), factors, FLOAT_MATHS));
  EXPECT_TRUE(all_close(windowed.opacities.read(queue), opacities, FLOAT_MATHS));
  const auto cut = std::count(opacities.begin(), opacities.end(), 0.0);
  EXPECT_GT(cut, 0);
  EXPECT_LT(cut, std::ptrdiff_t(N_NATIVE4D));
}

TEST(Native4d, DeviceGradientOfTwoTimesIsTheSumForWhatWasSeenAndUntouchedElsewhere) {
  Queue queue = test_queue();
  Native4dMotion motion(queue, .05f);
  Native4dModel m = random_model(queue, motion);
  Random random(6);
  reference::Named v;  // gradients of the Gaussians at two times
  std::vector<cl_uint> touched;
  for (size_t i = 0; i < N_NATIVE4D; ++i) {
    for (int k = 0; k < 3; ++k) append(v, "mean1", {random()}), append(v, "mean2", {random()});
    for (int k = 0; k < 9; ++k) append(v, "factor1", {random()}), append(v, "factor2", {random()});
    append(v, "opacity", {random()});
    touched.push_back(i % 3 ? 4 : 0);
  }
  reference::Named expected = reference::zeros_like(m.values);
  for (size_t i = 0; i < N_NATIVE4D; ++i) {
    const Native4d g = reference::native4d_row(m.values, i);
    if (!touched[i]) continue;
    reference::add_native4d_row(expected, i,
                                slice_vjp(g, .25, reference::row3(v["mean1"], i),
                                          reference::rows9(v["factor1"], i), v["opacity"][i]));
    reference::add_native4d_row(
        expected, i,
        slice_vjp(g, .375, reference::row3(v["mean2"], i), reference::rows9(v["factor2"], i), 0));
  }
  for (auto& group : m.p.groups) group.grads.fill(queue, 7.f);
  const Buffer<cl_uint> tiles_touched(queue, touched, "tiles_touched");
  const auto upload = [&](const char* name) {
    return Buffer<float>(queue, to_float(v[name]), name);
  };
  const Buffer<float> opacity = upload("opacity");
  motion.backward(queue, m.p, .25f, true, tiles_touched, upload("mean1"), upload("factor1"),
                  opacity);
  motion.backward(queue, m.p, .375f, false, tiles_touched, upload("mean2"), upload("factor2"),
                  opacity);
  for (auto& [name, values] : expected) {
    const size_t width = values.size() / N_NATIVE4D;
    for (size_t i = 0; i < N_NATIVE4D; ++i)
      if (!touched[i]) std::fill_n(values.begin() + i * width, width, 7.0);
    // 1/|p_t|^4 of the shortest lifetimes multiplies the rounding, so the test compares norms.
    EXPECT_LT(relative_l2(m.p[name].grads.read(queue), values), 1e-5) << name;
  }
  const std::vector<cl_uint> seen = m.p.rows.seen.read(queue);
  for (size_t i = 0; i < N_NATIVE4D; ++i) EXPECT_EQ(seen[i], touched[i] ? 1u : 0u);
}

}  // namespace
}  // namespace gflow
