// SPDX-License-Identifier: Apache-2.0
// The table of hand-written derivatives. Each device kernel is compared with double: the same
// source compiled for double (kernels/shared), the reference's plain loops (optim/reference), or
// extrapolated differences of the double forward function. Each double derivative is compared with
// central differences.
#include <map>

#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/splats.hpp"
#include "apps/stress/stress.hpp"
#include "optim/density/mcmc.hpp"
#include "optim/density/static_detection.hpp"
#include "optim/motion/color.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {

// Defined in derivatives_of_cameras.cpp and so on.
std::vector<Derivative> camera_derivatives(Queue& queue);
std::vector<Derivative> motion_derivatives(Queue& queue);
std::vector<Derivative> motion_loss_derivatives(Queue& queue);
std::vector<Derivative> loss_derivatives(Queue& queue);
#ifdef GFLOW_WITH_OPENCV
// Defined in training/derivatives_of_host.cpp.
std::vector<Derivative> host_derivatives();
#endif

namespace {

Derivative transport_row(Queue& queue, int mode) {
  Random random(41);
  Floats m1, m2, gh;
  std::vector<double> expected;
  double differences = 0;
  for (size_t i = 0; i < 200; ++i) {
    const Axes a = random_axes(random, random.uniform(1, 60), .5);
    const Mat3 mix = mixture(random, i % 2);
    add_factor(m1, a, mix);
    add_factor(m2, a.changed(random, .2), mix);
    for (int k = 0; k < 4; ++k) gh.push_back(float(random.normal()));
    const Mat23 a1 = factor_at(m1, i), a2 = factor_at(m2, i);
    const Mat2 g{gh[4 * i], gh[4 * i + 1], gh[4 * i + 2], gh[4 * i + 3]};
    const TransportGradient v = transport_vjp(mode, a1, whiten(a1), a2, g);
    std::vector<double> x = flat(a1), found = flat(v.m1);
    for (const double y : flat(a2)) x.push_back(y);
    for (const double y : flat(v.m2)) found.push_back(y);
    expected.insert(expected.end(), found.begin(), found.end());
    // v^T (A - I) d at fixed pixels d = inv(K) z: gh : H K inv(K1), by M1 and M2.
    const Mat2 u = whitening_u(whiten(a1));
    const auto loss = [&](const std::vector<double>& y) {
      const Mat23 b1{{y[0], y[1], y[2]}, {y[3], y[4], y[5]}};
      const Mat23 b2{{y[6], y[7], y[8]}, {y[9], y[10], y[11]}};
      const Whitening w = whiten(b1);
      const Mat2 map = mat2_mul(mat2_mul(transport(mode, b1, w, b2), whitening_k(w)), u);
      return g.a * map.a + g.b * map.b + g.c * map.c + g.d * map.d;
    };
    differences = worse(differences, relative_error(found, slopes(loss, x, 1e-3)));
  }
  const DeviceMaths::Transported t = DeviceMaths(queue).transport(mode, m1, m2, gh);
  Floats actual;
  for (size_t i = 0; i < 200; ++i) {
    actual.insert(actual.end(), &t.v_m1[6 * i], &t.v_m1[6 * i] + 6);
    actual.insert(actual.end(), &t.v_m2[6 * i], &t.v_m2[6 * i] + 6);
  }
  return {"transport " + mode_name(mode),
          "projected factors at t1, t2",
          relative_error(actual, expected),
          differences,
          1e-4,
          1e-6};
}

Derivative project_row(Queue& queue) {
  const PinholeCamera c = random_scene({0, 64, 48}).shot.camera;
  Random random(42);
  Floats means, factors, v2, vz, vm;
  std::vector<double> expected;
  double differences = 0;
  constexpr size_t n = 100;
  for (size_t i = 0; i < n; ++i) {
    const double wide = i % 2 ? .9 : .2;  // some are clamped at the field-of-view margin
    const real3 p = world_of(c, {wide * 4, -.1 * 4, 4 + random.uniform(-.2, .2)});
    std::vector<double> x{p.x, p.y, p.z};
    for (int k = 0; k < 9; ++k) x.push_back(random.normal());
    for (double& y : x) y = double(float(y));
    means.insert(means.end(), {float(x[0]), float(x[1]), float(x[2])});
    for (size_t k = 3; k < 12; ++k) factors.push_back(float(x[k]));
    Floats v;
    for (int k = 0; k < 9; ++k) v.push_back(float(random.normal()));
    v2.insert(v2.end(), {v[0], v[1]});
    vz.push_back(v[2]);
    vm.insert(vm.end(), v.begin() + 3, v.end());
    const Mat23 v_m{{v[3], v[4], v[5]}, {v[6], v[7], v[8]}};
    const auto at = [&](const std::vector<double>& y) {
      return project(c, {y[0], y[1], y[2]},
                     {{y[3], y[4], y[5]}, {y[6], y[7], y[8]}, {y[9], y[10], y[11]}});
    };
    const Mat3 factor{{x[3], x[4], x[5]}, {x[6], x[7], x[8]}, {x[9], x[10], x[11]}};
    const GaussianGradient g = project_vjp(c, factor, at(x), {v[0], v[1]}, v[2], v_m);
    const std::vector<double> found{g.mean.x,      g.mean.y,      g.mean.z,      g.factor.r1.x,
                                    g.factor.r1.y, g.factor.r1.z, g.factor.r2.x, g.factor.r2.y,
                                    g.factor.r2.z, g.factor.r3.x, g.factor.r3.y, g.factor.r3.z};
    expected.insert(expected.end(), found.begin(), found.end());
    const auto loss = [&](const std::vector<double>& y) {
      const Projection o = at(y);
      return dot(o.mean, make_real2(v[0], v[1])) + o.p.z * double(v[2]) + dot(o.m.r1, v_m.r1) +
             dot(o.m.r2, v_m.r2);
    };
    differences = worse(differences, relative_error(found, slopes(loss, x, 1e-4)));
  }
  const DeviceMaths::Projected p = DeviceMaths(queue).project(c, means, factors, v2, vz, vm);
  Floats actual;
  for (size_t i = 0; i < n; ++i) {
    actual.insert(actual.end(), &p.v_means[3 * i], &p.v_means[3 * i] + 3);
    actual.insert(actual.end(), &p.v_factors[9 * i], &p.v_factors[9 * i] + 9);
  }
  return {"project", "mean, factor", relative_error(actual, expected), differences, 1e-4, 1e-6};
}

// The whole image: splat_bwd, gather, project_bwd, posed_bwd.
Derivative image_row(Queue& queue, const std::string& image, Transport transport, int top_k,
                     StopRule stop) {
  SceneSpec spec;
  spec.n = 25;
  spec.width = 19;
  spec.height = 13;
  spec.seed = 43;
  PosedScene s = random_scene(spec);
  s.shot.settings.transport = transport;
  s.shot.settings.top_k = top_k;
  s.shot.settings.stop = stop;
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  const reference::Planes v = only(random_cotangents(s, 43, r.contributors.doubtful), image);
  const reference::Named expected =
      reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v));
  DeviceScene device(queue, s);
  device.forward();
  const FloatArrays found = device.backward(v);
  double to_double = 0, differences = 0;
  std::string parameters;
  for (const auto& [name, gradient] : expected) {
    if (norm(gradient) < 1e-9) continue;  // the image does not depend on it
    parameters += (parameters.empty() ? "" : " ") + name;
    to_double = worse(to_double, relative_l2(found.at(name), gradient));
    // Along four random directions: one parameter at a time would take minutes.
    Random random(44);
    for (int k = 0; k < 4; ++k) {
      std::vector<double> direction(gradient.size());
      double along = 0;
      for (size_t i = 0; i < direction.size(); ++i) {
        direction[i] = random.normal();
        along += direction[i] * gradient[i];
      }
      reference::Named moved = s.p;
      const std::vector<double>& from = s.p.at(name);
      std::vector<double>& to = moved.at(name);
      const auto loss = [&](const std::vector<double>& step) {
        for (size_t i = 0; i < direction.size(); ++i) to[i] = from[i] + step[0] * direction[i];
        return inner(reference::render(s.shot, reference::posed(moved), &r.contributors).images, v);
      };
      const double slope = slopes(loss, {0}, 1e-4)[0];
      differences = worse(differences, std::fabs(slope - along) / norm(gradient));
    }
  }
  std::string kernel = "splat_bwd, " + image;
  if (image == "flow") kernel += fmt::format(" {}", name_of(transport));
  if (top_k) kernel += fmt::format(" top {}", top_k);
  if (stop == StopRule::exclude) kernel += " exclude";
  return {kernel, parameters, to_double, differences, 1e-4, 1e-6};
}

Derivative posed_row(Queue& queue) {
  Random random(45);
  constexpr size_t n = 100;
  Floats q, s, v;
  std::vector<double> expected;
  double differences = 0;
  for (size_t i = 0; i < n; ++i) {
    std::vector<double> x;
    for (int k = 0; k < 7; ++k) x.push_back(double(float(random.normal())));
    Floats w;
    for (int k = 0; k < 9; ++k) w.push_back(float(random.normal()));
    for (size_t k = 0; k < 7; ++k) (k < 4 ? q : s).push_back(float(x[k]));
    v.insert(v.end(), w.begin(), w.end());
    const Mat3 vl{{w[0], w[1], w[2]}, {w[3], w[4], w[5]}, {w[6], w[7], w[8]}};
    const FactorGradient g = factor_of_vjp({x[0], x[1], x[2], x[3]}, {x[4], x[5], x[6]}, vl);
    const std::vector<double> found{g.quat.x,   g.quat.y,   g.quat.z,  g.quat.w,
                                    g.scales.x, g.scales.y, g.scales.z};
    expected.insert(expected.end(), found.begin(), found.end());
    const auto loss = [&](const std::vector<double>& y) {
      const Mat3 l = factor_of({y[0], y[1], y[2], y[3]}, {y[4], y[5], y[6]});
      return dot(l.r1, vl.r1) + dot(l.r2, vl.r2) + dot(l.r3, vl.r3);
    };
    differences = worse(differences, relative_error(found, slopes(loss, x, 1e-4)));
  }
  Posed posed(queue);
  const Buffer<float> quats(queue, q, "quats"), scales(queue, s, "scales"), vf(queue, v, "v");
  Buffer<float> v_quats, v_scales;
  posed.backward(queue, quats, scales, vf, v_quats, v_scales);
  const Floats a = v_quats.read(queue), b = v_scales.read(queue);
  Floats actual;
  for (size_t i = 0; i < n; ++i) {
    actual.insert(actual.end(), &a[4 * i], &a[4 * i] + 4);
    actual.insert(actual.end(), &b[3 * i], &b[3 * i] + 3);
  }
  return {"posed_bwd", "quats scales", relative_error(actual, expected), differences, 1e-4, 1e-6};
}

Derivative sh_row(Queue& queue) {
  constexpr size_t n = 40;
  const PinholeCamera camera = random_scene({}).shot.camera;
  const real3 centre = reference::camera_centre(camera);
  Random random(46);
  reference::Named p;
  Floats v;
  for (size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      append(p, "means", {random.normal()});
      append(p, "sh0", {2 + random.uniform(0, 1)});  // no channel near the clamp at 0
      v.push_back(float(random.normal()));
    }
    for (int k = 0; k < 45; ++k) append(p, "sh_rest", {.1 * random.normal()});
  }
  reference::Named expected = reference::zeros_like(p);
  double differences = 0;
  for (size_t i = 0; i < n; ++i)
    reference::add_row3(expected["means"], i,
                        reference::sh_color_vjp(p, i, 3, reference::row3(p["means"], i), centre,
                                                {v[3 * i], v[3 * i + 1], v[3 * i + 2]}, expected));
  for (const auto& [name, gradient] : expected) {
    const auto loss = [&, key = name](const std::vector<double>& x) {
      reference::Named moved = p;
      moved[key] = x;
      double sum = 0;
      for (size_t i = 0; i < n; ++i)
        sum += dot(reference::sh_color(moved, i, 3, reference::row3(moved["means"], i), centre),
                   {v[3 * i], v[3 * i + 1], v[3 * i + 2]});
      return sum;
    };
    const std::vector<size_t> some = spread_indices(gradient.size(), 200);
    differences = worse(differences,
                        relative_error(picked(gradient, some), slopes(loss, p[name], 1e-3, some)));
  }
  Color color(queue, 3);
  Parameters parameters(queue, n, color_groups(3));
  for (const char* name : {"sh0", "sh_rest"})
    parameters[name].values.write(queue, to_float(p[name]));
  GaussiansAt at;
  at.ensure(queue, n);
  at.means.write(queue, to_float(p["means"]));
  at.opacities.fill(queue, 1.f);
  GaussianGradients g;
  g.zero(queue, n);
  g.v_colors.write(queue, v);
  color.backward(queue, parameters, {3, 3}, camera, at,
                 Buffer<cl_uint>(queue, std::vector<cl_uint>(n, 1u), "touched"), g);
  const double to_double =
      worst({relative_l2(g.v_means.read(queue), expected["means"]),
             relative_l2(parameters["sh0"].grads.read(queue), expected["sh0"]),
             relative_l2(parameters["sh_rest"].grads.read(queue), expected["sh_rest"])});
  return {"sh_bwd", "means sh0 sh_rest", to_double, differences, 1e-4, 1e-6};
}

// Regularisation of opacity and scales (mcmc).
Derivative price_row(Queue& queue) {
  constexpr size_t n = 60;
  Random random(49);
  Floats x;  // logits, then log scales; the fourth, temporal one has no cost
  for (size_t i = 0; i < n; ++i) x.push_back(float(3 * random.normal()));
  for (size_t i = 0; i < 4 * n; ++i) x.push_back(float(random.uniform(-6, 1)));
  DensityRule rule;
  rule.opacity_weight = .3f;
  rule.scale_weight = .7f;
  const double by_opacity = double(rule.opacity_weight) / n;
  const double by_scale = double(rule.scale_weight) / (3 * n);
  const auto cost = [&](const std::vector<double>& y) {
    double sum = 0;
    for (size_t i = 0; i < n; ++i) {
      sum += by_opacity / (1 + std::exp(-y[i]));
      for (size_t k = 0; k < 3; ++k) sum += by_scale * std::exp(y[n + 4 * i + k]);
    }
    return sum;
  };
  std::vector<double> at(x.begin(), x.end()), expected(5 * n);
  for (size_t i = 0; i < n; ++i) {
    const double o = 1 / (1 + std::exp(-at[i]));
    expected[i] = by_opacity * o * (1 - o);
    for (size_t k = 0; k < 3; ++k) expected[n + 4 * i + k] = by_scale * std::exp(at[n + 4 * i + k]);
  }
  Parameters p(queue, n, {{"logit_opacities", 1}, {"log_scales", 4}});
  p["logit_opacities"].values.write(queue, Floats(x.begin(), x.begin() + n));
  p["log_scales"].values.write(queue, Floats(x.begin() + n, x.end()));
  for (ParameterGroup& group : p.groups) group.grads.fill(queue, 0.f);
  p.rows.seen.fill(queue, 1u);
  McmcDensity(queue).add_gradients(queue, p, rule);
  Floats found = p["logit_opacities"].grads.read(queue);
  const Floats of_scales = p["log_scales"].grads.read(queue);
  found.insert(found.end(), of_scales.begin(), of_scales.end());
  return {"mcmc_shrink",
          "logit_opacities log_scales",
          relative_error(found, expected),
          relative_error(expected, slopes(cost, at, 1e-3)),
          1e-4,
          1e-6};
}

// The criterion that makes static Gaussians dynamic again: the gradient by the velocities they
// would have, for a view that draws them at both times, and for one in which they are static (at t2
// they are where they are at t).
Derivative static_gradient_row(Queue& queue) {
  constexpr size_t n = 40;
  const float t = .7f, t2 = .9f;
  Random random(51);
  const auto numbers = [&](size_t count) {
    Floats x;
    while (x.size() < count) x.push_back(float(random.normal()));
    return x;
  };
  const Floats means_t = numbers(n), v = numbers(3 * n), v2 = numbers(3 * n);
  Parameters p(queue, n, {{"means_t", 1}});
  p["means_t"].values.write(queue, means_t);
  p.moving = 0;
  const Buffer<cl_uint> seen(queue, std::vector<cl_uint>(n, 1u), "seen");
  const Buffer<float> v_means(queue, v, "v_means"), v_means_t2(queue, v2, "v_means_t2");
  ViewRows rows(queue);
  rows.take_all(p);
  Floats found;
  for (const bool stood_still : {false, true}) {
    StaticDetection detection(queue);
    detection.see(queue, p, rows, seen, t, v_means, &t2, v_means_t2, stood_still);
    Arrays state;
    detection.save_state(queue, p, state);
    const auto& sums = std::get<Floats>(state.at("rest/pulls").values);
    for (size_t i = 0; i < n; ++i) found.insert(found.end(), &sums[4 * i], &sums[4 * i] + 3);
  }
  const auto since = [&](size_t k, bool stood_still) {  // how long velocities act until t2
    return double(t2) - (stood_still ? double(t) : double(means_t[k / 3]));
  };
  // Positions in the two views: at t on the line through the mean; at t2 on the same line, or
  // displaced from the position at t by the velocity times t2 - t.
  const Floats means = numbers(3 * n);
  const auto cost = [&](const std::vector<double>& velocities) {
    double sum = 0;
    for (size_t k = 0; k < 6 * n; ++k) {
      const size_t i = k % (3 * n);
      const auto on_line = [&](double when) {
        return double(means[i]) + velocities[k] * (when - double(means_t[i / 3]));
      };
      const double drawn = double(means[i]);  // without a velocity
      const bool stood_still = k >= 3 * n;
      sum += double(v[i]) * on_line(double(t)) +
             double(v2[i]) * (stood_still ? drawn + velocities[k] * (double(t2) - double(t))
                                          : on_line(double(t2)));
    }
    return sum;
  };
  std::vector<double> expected;
  for (const bool stood_still : {false, true})
    for (size_t k = 0; k < 3 * n; ++k)
      expected.push_back(double(v[k]) * (double(t) - double(means_t[k / 3])) +
                         double(v2[k]) * since(k, stood_still));
  const std::vector<double> at(6 * n, 0.1);
  return {"static_accumulate",
          "velocities of static Gaussians",
          relative_error(found, expected),
          relative_error(expected, slopes(cost, at, 1e-3)),
          1e-4,
          1e-6};
}

}  // namespace

std::vector<Derivative> derivatives(Queue& queue) {
  std::vector<Derivative> rows;
  for (const int mode : {TRANSPORT_PAPER, TRANSPORT_OT, TRANSPORT_MATERIAL})
    rows.push_back(transport_row(queue, mode));
  rows.push_back(project_row(queue));
  for (const char* image : {"rgb", "alpha", "depth"})
    rows.push_back(image_row(queue, image, Transport::material, 0, StopRule::include));
  for (const Transport t :
       {Transport::paper, Transport::ot, Transport::material, Transport::translate})
    rows.push_back(image_row(queue, "flow", t, 0, StopRule::include));
  rows.push_back(image_row(queue, "flow", Transport::paper, 3, StopRule::exclude));
  rows.push_back(posed_row(queue));
  rows.push_back(sh_row(queue));
  for (const auto& more :
       {camera_derivatives, motion_derivatives, motion_loss_derivatives, loss_derivatives})
    for (Derivative& row : more(queue)) rows.push_back(std::move(row));
  rows.push_back(price_row(queue));
  rows.push_back(static_gradient_row(queue));
#ifdef GFLOW_WITH_OPENCV
  for (Derivative& row : host_derivatives()) rows.push_back(std::move(row));
#endif
  return rows;
}

}  // namespace gflow::stress
