// SPDX-License-Identifier: Apache-2.0
// Spherical harmonics against Legendre functions and their orthonormality; derivatives against
// central differences; colour on the device against double.
#include "optim/motion/color.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {
namespace {

const double PI = 3.14159265358979323846;

real3 unit(real3 v) { return v * (1 / std::sqrt(dot(v, v))); }

// Real Y_lm with the Condon-Shortley phase, order m = -l .. l, as in 3DGS files.
double harmonic(int l, int m, real3 d) {
  const int a = std::abs(m);
  double factorials = 1;  // (l - a)! / (l + a)!
  for (int k = l - a + 1; k <= l + a; ++k) factorials /= k;
  const double n = std::sqrt((2 * l + 1) / (4 * PI) * factorials) * (a % 2 ? -1 : 1);
  const double phi = std::atan2(d.y, d.x), p = std::assoc_legendre(l, a, d.z);
  if (m == 0) return n * p;
  return std::sqrt(2.) * n * p * (m > 0 ? std::cos(a * phi) : std::sin(a * phi));
}

// The constants of sh.h are float32: 6e-8 relative.
TEST(Sh, BasisIsTheRealSphericalHarmonics) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const real3 d = unit(random.three());
    const ShBasis b = sh_basis(3, d);
    for (int l = 0, k = 0; l <= 3; ++l)
      for (int m = -l; m <= l; ++m, ++k)
        EXPECT_NEAR(b.y[k], harmonic(l, m, d), 3e-7) << l << " " << m;
  }
}

TEST(Sh, BasisIsOrthonormalOnTheSphere) {
  // Midpoints in phi are exact up to order 31; Simpson in z for polynomials of degree 6: 1e-8.
  double products[16][16] = {};
  const int rows = 400, columns = 32;
  for (int r = 0; r <= rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const double z = -1 + 2. * r / rows, phi = 2 * PI * (c + .5) / columns;
      const double s = std::sqrt(std::max(0., 1 - z * z));
      const double simpson = (r == 0 || r == rows ? 1 : r % 2 ? 4 : 2) * (2. / rows) / 3;
      const ShBasis b = sh_basis(3, {s * std::cos(phi), s * std::sin(phi), z});
      for (int i = 0; i < 16; ++i)
        for (int j = 0; j < 16; ++j)
          products[i][j] += b.y[i] * b.y[j] * simpson * (2 * PI / columns);
    }
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) EXPECT_NEAR(products[i][j], i == j, 5e-7) << i << " " << j;
}

TEST(Sh, BandsAboveTheDegreeAreZero) {
  for (int degree = 0; degree < 3; ++degree) {
    const ShBasis b = sh_basis(degree, unit({1, 2, 3}));
    for (int k = (degree + 1) * (degree + 1); k < 16; ++k) EXPECT_EQ(b.y[k], 0);
  }
}

TEST(Sh, GradientByThePointEqualsCentralDifferences) {
  Random random(2);
  for (int degree = 1; degree <= 3; ++degree)
    for (int i = 0; i < 10; ++i) {
      ShBasis v;
      for (double& y : v.y) y = random();
      const real3 point = random.three(), camera = random.three() * 3;
      const Direction o = direction_to(point, camera);
      for (int k = (degree + 1) * (degree + 1); k < 16; ++k) v.y[k] = 0;
      const real3 actual = direction_to_vjp(o, sh_basis_vjp(degree, o.d, v));
      const auto loss = [&](const std::vector<double>& x) {
        const ShBasis b = sh_basis(degree, direction_to({x[0], x[1], x[2]}, camera).d);
        double sum = 0;
        for (int k = 0; k < 16; ++k) sum += b.y[k] * v.y[k];
        return sum;
      };
      EXPECT_TRUE(all_close(std::vector<double>{actual.x, actual.y, actual.z},
                            numeric_gradient(loss, {point.x, point.y, point.z}), {1e-6, 1e-7}));
    }
}

// ---- on the device

constexpr size_t N_SH = 29;

// lanes 0: the device's own; 1: the kernels of GPUs. Their loops are unrolled to degree 3 for any
// stored degree: without their guards they would write into the next Gaussian's row.
class ShLanes : public testing::TestWithParam<std::tuple<int, int>> {
 public:
  const int lanes = std::get<0>(GetParam()), stored = std::get<1>(GetParam());
  const size_t rest = size_t(3 * ((stored + 1) * (stored + 1) - 1));
};
INSTANTIATE_TEST_SUITE_P(All, ShLanes,
                         testing::Combine(testing::Values(0, 1), testing::Values(1, 2, 3)));

TEST_P(ShLanes, DeviceColoursAndGradientsAreTheDoubleOnes) {
  Queue queue = test_queue(lanes);
  Color color(queue, stored);
  const PinholeCamera camera = random_scene({}).shot.camera;
  const real3 centre = reference::camera_centre(camera);
  Random random(3);
  reference::Named p, v;
  std::vector<cl_uint> touched, seen;
  for (size_t i = 0; i < N_SH; ++i) {
    for (int k = 0; k < 3; ++k) {
      append(p, "means", {3 * random()});
      append(p, "sh0", {2 * random()});
      append(v, "colors", {random()});
    }
    for (size_t k = 0; k < rest; ++k) append(p, "sh_rest", {.3 * random()});
    touched.push_back(i % 4 != 0);
    seen.push_back(i % 3 == 0);
  }
  GaussiansAt gaussians;
  gaussians.ensure(queue, N_SH);
  gaussians.means.write(queue, to_float(p["means"]));
  gaussians.opacities.fill(queue, 1.f);
  const Buffer<cl_uint> tiles_touched(queue, touched, "tiles_touched");
  for (int at = 0; at <= 2 * stored + 1; ++at) {
    const int degree = at / 2;
    const bool skip = at % 2;  // the bands above
    SCOPED_TRACE(fmt::format("degree {}, skip {}", degree, skip));
    Parameters parameters(queue, N_SH, color_groups(stored));
    for (const char* name : {"sh0", "sh_rest"})
      parameters[name].values.write(queue, to_float(p[name]));
    Buffer<float> colors;
    const Buffer<cl_uint> all(queue, std::vector<cl_uint>(N_SH, 1u), "seen");
    color.forward(queue, parameters, color.bands(degree, skip), camera, gaussians, all, colors);

    // v_means starts at 2, gradients of seen rows at 1, of others at 7: the kernel sets the latter.
    GaussianGradients g;
    g.ensure(queue, N_SH);
    g.v_colors.write(queue, to_float(v["colors"]));
    g.v_means.fill(queue, 2.f);
    for (auto& group : parameters.groups) group.grads.fill(queue, 1.f);
    for (size_t i = 0; i < N_SH; ++i)
      if (!seen[i]) {
        parameters["sh0"].grads.fill_range(queue, 3 * i, 3, 7.f);
        parameters["sh_rest"].grads.fill_range(queue, rest * i, rest, 7.f);
      }
    parameters.rows.seen.write(queue, seen);
    color.backward(queue, parameters, color.bands(degree, skip), camera, gaussians, tiles_touched,
                   g);

    reference::Named expected = reference::zeros_like(p);
    std::vector<double> expected_colors, expected_means(3 * N_SH, 2.);
    for (size_t i = 0; i < N_SH; ++i) {
      const real3 mean = reference::row3(p["means"], i);
      const real3 c = reference::sh_color(p, i, degree, mean, centre);
      for (double x : {c.x, c.y, c.z}) expected_colors.push_back(x);
      const double start = seen[i] ? 1 : touched[i] ? 0 : 7;
      for (size_t k = 0; k < 3; ++k) expected["sh0"][3 * i + k] = start;
      const double static_start = !seen[i] && degree == 0 && skip ? 7 : start;  // left unchanged
      for (size_t k = 0; k < rest; ++k) expected["sh_rest"][rest * i + k] = static_start;
      if (touched[i])
        reference::add_row3(expected_means, i,
                            reference::sh_color_vjp(p, i, degree, mean, centre,
                                                    reference::row3(v["colors"], i), expected));
    }
    // 16 products of order 1 in float32.
    const Tolerance tolerance{2e-6, 2e-6};
    EXPECT_TRUE(all_close(colors.read(queue), expected_colors, tolerance));
    EXPECT_TRUE(all_close(parameters["sh0"].grads.read(queue), expected["sh0"], tolerance));
    EXPECT_TRUE(all_close(parameters["sh_rest"].grads.read(queue), expected["sh_rest"], tolerance));
    EXPECT_TRUE(all_close(g.v_means.read(queue), expected_means, tolerance));
  }
}

}  // namespace
}  // namespace gflow
