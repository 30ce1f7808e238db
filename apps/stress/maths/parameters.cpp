// SPDX-License-Identifier: Apache-2.0
// T25-T27: quaternions of any length, scales and opacities far beyond those of training, through
// the kernels of the motion models.
#include <Eigen/Geometry>

#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/engine/posed.hpp"
#include "optim/motion/models.hpp"
#include "shared/motion/life.h"
#include "shared/quat.h"

namespace gflow::stress {
namespace {

using Floats = std::vector<float>;

Rows quaternions(Queue& queue) {  // T25
  Rows rows;
  Posed posed(queue);
  constexpr size_t n = 200;
  Random random(25);
  Floats unit, v;
  for (size_t i = 0; i < n; ++i) {
    real4 q{random.normal(), random.normal(), random.normal(), random.normal()};
    q = quat_normalize(q).q;
    unit.insert(unit.end(), {float(q.x), float(q.y), float(q.z), float(q.w)});
    for (int k = 0; k < 9; ++k) v.push_back(float(random.normal()));
  }
  const Buffer<float> scales(queue, Floats(3 * n, .7f), "scales"), v_factors(queue, v, "v");
  for (const float length : {0.f, 1e-30f, 1e-19f, 1e-7f, 1e-5f, 1e-3f, 1.f, 1e3f, 1e10f, 2e19f}) {
    Floats quats;
    for (const float x : unit) quats.push_back(length * x);
    const Buffer<float> q(queue, quats, "quats");
    Buffer<float> factors, v_quats, v_scales;
    posed.forward(queue, q, scales, factors);
    posed.backward(queue, q, scales, v_factors, v_quats, v_scales);
    const Floats found = factors.read(queue), g = v_quats.read(queue);
    const std::string at = fmt::format("|q| = {:.0e}", length);
    rows.push_back({at + ", non-finite factors and gradients",
                    count_not_finite(found) + count_not_finite(g), 0});
    double rotation = 0, radial = 0;
    for (size_t i = 0; i < n; ++i) {
      Eigen::Quaterniond e(unit[4 * i], unit[4 * i + 1], unit[4 * i + 2], unit[4 * i + 3]);
      if (length < 1e-6f) e.setIdentity();  // too short to define a rotation
      const Eigen::Matrix3d l = e.normalized().toRotationMatrix() * double(.7f);
      const std::vector<double> expected{l(0, 0), l(0, 1), l(0, 2), l(1, 0), l(1, 1),
                                         l(1, 2), l(2, 0), l(2, 1), l(2, 2)};
      rotation =
          worse(rotation, row_error(Floats(&found[9 * i], &found[9 * i] + 9), expected, 0, 9));
      double along = 0, size = 0;
      for (size_t k = 0; k < 4; ++k) {
        along += double(g[4 * i + k]) * double(unit[4 * i + k]);
        size += std::pow(double(g[4 * i + k]), 2);
      }
      if (size > 0) radial = worse(radial, std::fabs(along) / std::sqrt(size));
      if (length < 1e-6f) radial = worse(radial, std::sqrt(size) > 0 ? infinite : 0.);
    }
    rows.push_back({at + ", rotation, relative", rotation, 1e-6});
    rows.push_back({at + ", gradient along q, relative", radial, 1e-6});
  }
  return rows;
}

// One row per value of a group, all else ordinary, through forward and backward of the default
// model.
struct Response {
  Floats factors, opacities, by_scales, by_opacity;
};
Response respond(Queue& queue, const std::string& name, const Floats& values) {
  const size_t n = values.size();
  MotionShape shape;
  const std::unique_ptr<Motion> motion = make_motion(queue, shape);
  Parameters p(queue, n, motion->groups(), motion->tables());
  HostGroups groups{{"means", Floats(3 * n, .1f)},
                    {"means_t", Floats(n, .5f)},
                    {"quats", {}},
                    {"log_scales", {}},
                    {"logit_opacities", Floats(n, 1.f)}};
  for (size_t i = 0; i < n; ++i) {
    groups["quats"].insert(groups["quats"].end(), {1.f, .2f, -.1f, .3f});
    groups["log_scales"].insert(groups["log_scales"].end(), {-1.f, -2.f, -3.f, 1.f});
  }
  set_static(shape, groups, n);
  if (name == "log_scales")
    for (size_t i = 0; i < n; ++i)
      for (int k = 0; k < 3; ++k) groups[name][4 * i + size_t(k)] = values[i];
  else
    groups[name] = values;
  for (Table* table : p.tables())
    for (ParameterGroup& group : table->groups)
      group.values.write(queue, groups.at(group.values.name()));
  p.forget_seen(queue);
  GaussiansAt at;
  const Buffer<cl_uint> seen(queue, std::vector<cl_uint>(n, 1u), "seen");
  motion->at(queue, p, .5f, nullptr, at);
  motion->backward(queue, p, .5f, true, seen, Buffer<float>(queue, Floats(3 * n, 1.f), "v"),
                   Buffer<float>(queue, Floats(9 * n, 1.f), "v"),
                   Buffer<float>(queue, Floats(n, 1.f), "v"));
  return {at.factors.read(queue), at.opacities.read(queue), p["log_scales"].grads.read(queue),
          p["logit_opacities"].grads.read(queue)};
}

Rows parameter_scales(Queue& queue) {  // T26
  Floats values;
  for (float x = -100; x <= 100; x += 2.5f) values.push_back(x);
  const Response found = respond(queue, "log_scales", values);
  double broken = 0, drawn = 0, lost = 0;
  std::vector<double> errors;
  for (size_t i = 0; i < values.size(); ++i) {
    // exp(x) is finite in float up to 88.7. Above that the factor must be infinite, and the engine
    // culls it.
    const double expected = std::exp(double(values[i]));
    const Mat3 l = factor_of({1.f, .2f, -.1f, .3f}, {expected, expected, expected});
    if (values[i] > -87 && values[i] < 88) {
      errors.push_back(std::fabs(double(found.factors[9 * i]) / l.r1.x - 1));
      broken += count_not_finite(Floats(&found.by_scales[4 * i], &found.by_scales[4 * i] + 3));
    }
    // Below the smallest normal float devices may return 0 or the subnormal.
    if (values[i] <= -87)
      lost += !(std::fabs(found.factors[9 * i]) <= 2e-38f) +
              count_not_finite(Floats(&found.by_scales[4 * i], &found.by_scales[4 * i] + 3));
    const float size = found.factors[9 * i];
    drawn += values[i] > 89 && std::isfinite(size);
  }
  return {{"log s in -87 .. 88: factor, relative", worst(errors), 1e-5},
          {"log s in -87 .. 88: non-finite gradients", broken, 0},
          {"log s in -100 .. -87: non-finite, or not negligible", lost, 0},
          {"log s above 89: factors wrongly finite", drawn, 0}};
}

Rows opacities(Queue& queue) {  // T27
  Floats values;
  for (float x = -100; x <= 100; x += 1.25f) values.push_back(x);
  const Response found = respond(queue, "logit_opacities", values);
  std::vector<double> forward, backward;
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::fabs(values[i]) > 80) continue;
    const double x = double(values[i]), e = std::exp(-std::fabs(x));
    const double opacity = x > 0 ? 1 / (1 + e) : e / (1 + e);
    forward.push_back(std::fabs(double(found.opacities[i]) / opacity - 1));
    backward.push_back(std::fabs(double(found.by_opacity[i]) / (e / ((1 + e) * (1 + e))) - 1));
  }
  return {{"|x| <= 80: sigmoid, relative", worst(forward), 1e-6},
          {"|x| <= 80: derivative, relative", worst(backward), 1e-6},
          {"|x| <= 100: non-finite",
           count_not_finite(found.opacities) + count_not_finite(found.by_opacity), 0}};
}

}  // namespace

Tests parameter_tests() {
  return {{"T25", "length of quaternions", true, quaternions},
          {"T26", "saturated scales", true, parameter_scales},
          {"T27", "saturated opacities", true, opacities}};
}

}  // namespace gflow::stress
