// SPDX-License-Identifier: Apache-2.0
// T23, T24, T28: culling at the near plane, the gradient where J is clamped at the margin, and
// large coordinates.
#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/device_maths.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

Rows near_plane(Queue& queue) {  // T23; the plane is at .01f
  const float plane = .01f;
  struct Place {
    double z;
    bool drawn;
  };
  const Place places[] = {{-1, false},
                          {-0., false},
                          {0, false},
                          {1e-30, false},
                          {double(std::nextafter(plane, 0.f)), false},
                          {double(plane), true},
                          {double(std::nextafter(plane, 1.f)), true},
                          {double(plane) * (1 + 1e-3), true},
                          {2, true}};
  PosedScene s = random_scene({0, 64, 48});
  s.shot.camera = s.shot.camera_t2 = test_camera(64, 48);
  for (const Place& p : places) add_gaussian(s, {0, 0, p.z}, {.1, .1, .1}, .5, {0, 0, .3});
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  const std::vector<cl_uint> touched = device.engine.splats().tiles_touched.read(queue);
  const FloatArrays gradients = device.backward(random_cotangents(s, 23));
  double wrong = 0, not_zero = 0, broken = 0;
  for (const auto& [name, values] : images) broken += count_not_finite(values);
  for (const auto& [name, values] : gradients) {
    broken += count_not_finite(values);
    const size_t width = values.size() / s.count();
    for (size_t i = 0; i < values.size(); ++i)
      not_zero += !places[i / width].drawn && values[i] != 0;
  }
  for (size_t i = 0; i < s.count(); ++i) wrong += (touched[i] > 0) != places[i].drawn;
  return {{"z of -1 to near (1 +- ulp): wrongly culled or drawn", wrong, 0},
          {"non-zero gradients of culled Gaussians", not_zero, 0},
          {"non-finite images and gradients", broken, 0}};
}

// Gaussians inside and beyond the margin in x, y and both: the device's gradient against
// differences of the double projection, which are independent of the derivation.
Rows margin(Queue& queue) {  // T24
  Rows rows;
  const PinholeCamera c = random_scene({0, 64, 48}).shot.camera;
  DeviceMaths device(queue);
  const real2 places[] = {{.1, .1}, {.9, 0}, {0, -.9}, {-.9, .9}};
  for (const real2 where : places) {
    Random random(24);
    constexpr size_t n = 2000;
    Floats means, factors, v_means2d, v_depths, v_m;
    const auto add = [&](Floats& to, size_t count, double size) {
      for (size_t k = 0; k < count; ++k) to.push_back(float(size * random.normal()));
    };
    for (size_t i = 0; i < n; ++i) {
      const double z = random.uniform(2, 6);
      const real3 p = world_of(c, make_real3(where.x * z, where.y * z, z));
      means.insert(means.end(), {float(p.x), float(p.y), float(p.z)});
      add(factors, 9, .3);
      add(v_means2d, 2, 1);
      add(v_depths, 1, 1);
      add(v_m, 6, 1);
    }
    const DeviceMaths::Projected found =
        device.project(c, means, factors, v_means2d, v_depths, v_m);
    std::vector<double> errors;
    double held = 0;
    for (size_t i = 0; i < n; ++i) {
      const auto at3 = [](const Floats& a, size_t k) {
        return make_real3(a[3 * k], a[3 * k + 1], a[3 * k + 2]);
      };
      const Mat3 factor{at3(factors, 3 * i), at3(factors, 3 * i + 1), at3(factors, 3 * i + 2)};
      const Projection p = project(c, at3(means, i), factor);
      held += !p.u_inside || !p.v_inside;
      const auto loss = [&](const std::vector<double>& x) {
        const Projection o = project(c, {x[0], x[1], x[2]}, factor);
        return o.mean.x * double(v_means2d[2 * i]) + o.mean.y * double(v_means2d[2 * i + 1]) +
               o.p.z * double(v_depths[i]) + dot(o.m.r1, at3(v_m, 2 * i)) +
               dot(o.m.r2, at3(v_m, 2 * i + 1));
      };
      const std::vector<double> expected =
          slopes(loss, {means[3 * i], means[3 * i + 1], means[3 * i + 2]}, 1e-3);
      errors.push_back(
          row_error(Floats(&found.v_means[3 * i], &found.v_means[3 * i] + 3), expected, 0, 3));
    }
    const bool outside = std::fabs(where.x) > .5 || std::fabs(where.y) > .5;
    const std::string at = fmt::format("at ({}, {}) z", where.x, where.y);
    rows.push_back({at + ", gradient by the mean, worst", worst(errors), 1e-4});
    rows.push_back({at + ", wrongly clamped or not", outside ? double(n) - held : held, 0});
  }
  return rows;
}

// Gaussians and a camera `far` from the origin in float: the projection error from rounding R p +
// t. Scenes farther away must be recentred before training.
Rows far_from_origin(Queue& queue) {  // T28
  Rows rows;
  DeviceMaths device(queue);
  for (const double far : {0., 1., 3.}) {
    Random random(28);
    PinholeCamera c = test_camera(1920, 1080);
    place(c, {.9, .1, .3, -.2}, {0, 0, 0});
    const real3 centre{far, -far, .5 * far}, t = world_of(c, {0, 0, 0}) - centre;
    const float* r = c.rotation;
    for (int k = 0; k < 3; ++k)
      c.translation[k] = float(r[3 * k] * t.x + r[3 * k + 1] * t.y + r[3 * k + 2] * t.z);
    Floats means;
    constexpr size_t n = 1000;
    for (size_t i = 0; i < n; ++i) {
      const double z = random.uniform(2, 10);
      const real3 p = world_of(c, {random.uniform(-.4, .4) * z, random.uniform(-.25, .25) * z, z});
      means.insert(means.end(), {float(p.x), float(p.y), float(p.z)});
    }
    const DeviceMaths::Projected found =
        device.project(c, means, Floats(9 * n), Floats(2 * n), Floats(n), Floats(6 * n));
    std::vector<double> errors;
    for (size_t i = 0; i < n; ++i) {
      double p[3];  // R x + t
      for (size_t k = 0; k < 3; ++k) {
        p[k] = double(c.translation[k]);
        for (size_t j = 0; j < 3; ++j) p[k] += double(r[3 * k + j]) * double(means[3 * i + j]);
      }
      errors.push_back(
          std::hypot(double(found.means2d[2 * i]) - double(c.fx) * p[0] / p[2] - double(c.cx),
                     double(found.means2d[2 * i + 1]) - double(c.fy) * p[1] / p[2] - double(c.cy)));
    }
    rows.push_back({fmt::format("{} units from the origin, 1920 px, projection [px]", far),
                    worst(errors), 1e-3});
  }
  return rows;
}

}  // namespace

Tests projection_tests() {
  return {{"T23", "near plane", true, near_plane},
          {"T24", "field-of-view margin", true, margin},
          {"T28", "large coordinates", true, far_from_origin}};
}

}  // namespace gflow::stress
