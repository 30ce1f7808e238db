// SPDX-License-Identifier: Apache-2.0
// T7-T11, T15: H of the transports and its gradient on the device, for needles that move little and
// much, that do not move, and that rotate with the image.
#include <cstring>

#include "apps/stress/splats.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

constexpr int kCases = 4000;
const int kModes[] = {TRANSPORT_PAPER, TRANSPORT_OT, TRANSPORT_MATERIAL, TRANSPORT_TRANSLATE};

// Splats of length x width px at two times: rotated, tilted and scaled by `change` (standard
// deviation). Each has six pixels at |z| = 3 with cotangents v: gh = sum v z^T.
struct Cases {
  Floats m1, m2, z, gh;  // [n, 6], [n, 6], [n, 6, 2], [n, 4]
};
constexpr size_t kPixels = 6;
constexpr double kThin = 0.3;

Cases cases(double length, double change, unsigned seed, bool mixed = false, double width = kThin) {
  Random random(seed);
  Cases c;
  for (int i = 0; i < kCases; ++i) {
    const Axes first = random_axes(random, length, width);
    const Mat3 mix = mixture(random, mixed);
    add_factor(c.m1, first, mix);
    add_factor(c.m2, first.changed(random, change), mix);
    float gh[4] = {0, 0, 0, 0};
    for (size_t k = 0; k < kPixels; ++k) {
      const double angle = random.angle();
      const float z[2] = {float(3 * std::cos(angle)), float(3 * std::sin(angle))};
      const float v[2] = {float(random.normal()), float(random.normal())};
      c.z.insert(c.z.end(), z, z + 2);
      for (int e = 0; e < 4; ++e) gh[e] += v[e / 2] * z[e % 2];
    }
    c.gh.insert(c.gh.end(), gh, gh + 4);
  }
  return c;
}

Mat2 gh_at(const Cases& c, size_t i) {
  return {c.gh[4 * i], c.gh[4 * i + 1], c.gh[4 * i + 2], c.gh[4 * i + 3]};
}

struct TransportErrors {
  std::vector<double> moved;              // [px]; |H z| at |z| = 3
  std::vector<double> flow, h, gradient;  // [px], relative, relative
};

TransportErrors errors_of(DeviceMaths& device, int mode, const Cases& c) {
  const DeviceMaths::Transported found = device.transport(mode, c.m1, c.m2, c.gh);
  TransportErrors e;
  for (size_t i = 0; i < size_t(kCases); ++i) {
    const Mat23 m1 = factor_at(c.m1, i), m2 = factor_at(c.m2, i);
    const Whitening w = whiten(m1);
    const Mat2 h = transport(mode, m1, w, m2);
    const float* f = &found.h[4 * i];
    double error = 0;
    for (size_t k = 0; k < kPixels; ++k) {
      const double z1 = double(c.z[12 * i + 2 * k]), z2 = double(c.z[12 * i + 2 * k + 1]);
      const double dx = (double(f[0]) - h.a) * z1 + (double(f[1]) - h.b) * z2;
      const double dy = (double(f[2]) - h.c) * z1 + (double(f[3]) - h.d) * z2;
      e.moved.push_back(std::hypot(h.a * z1 + h.b * z2, h.c * z1 + h.d * z2));
      error = std::hypot(dx, dy) <= error ? error : std::hypot(dx, dy);  // keeps NaN
    }
    e.flow.push_back(error);
    const std::vector<double> flat_h{h.a, h.b, h.c, h.d};
    e.h.push_back(row_error(Floats(f, f + 4), flat_h, 0, 4));
    const TransportGradient v = transport_vjp(mode, m1, w, m2, gh_at(c, i));
    std::vector<double> expected = flat(v.m1);
    for (const double x : flat(v.m2)) expected.push_back(x);
    Floats actual(&found.v_m1[6 * i], &found.v_m1[6 * i] + 6);
    actual.insert(actual.end(), &found.v_m2[6 * i], &found.v_m2[6 * i] + 6);
    e.gradient.push_back(row_error(actual, expected, 0, 12));
  }
  return e;
}

struct CaseBounds {
  double length, change, flow_px, gradient;
};

Rows of_mode(Queue& queue, int mode, const std::vector<CaseBounds>& bounds) {
  Rows rows;
  DeviceMaths device(queue);
  for (const CaseBounds& b : bounds)
    for (const bool mixed : {false, true}) {
      const TransportErrors e = errors_of(device, mode, cases(b.length, b.change, 7, mixed));
      const std::string at =
          fmt::format("{:.0f} px long, {:.0f} % change, {:.2g} px{}", b.length, 100 * b.change,
                      quantile(e.moved, .5), mixed ? ", mixed" : "");
      rows.push_back({at + ", flow, 99 % [px]", quantile(e.flow, .99), b.flow_px});
      rows.push_back({at + ", gradient, 99 %", quantile(e.gradient, .99), b.gradient});
    }
  return rows;
}

Rows paper(Queue& queue) {  // T7
  return of_mode(queue, TRANSPORT_PAPER, {{300, .01, 1e-3, 1e-4}, {1000, .01, 1e-2, 1e-3}});
}
Rows material(Queue& queue) {  // T8
  return of_mode(queue, TRANSPORT_MATERIAL, {{300, .2, 2e-2, 1e-2}});
}

double count_not_plus_0(const Floats& values) {
  const float zero = 0;
  return double(std::count_if(values.begin(), values.end(), [&](const float& x) {
    return std::memcmp(&x, &zero, sizeof zero) != 0;
  }));
}

// Rendered flow of random static Gaussians must be +0; -0 counts as an error.
void drawn_static(Queue& queue, Rows& rows) {
  PosedScene s = random_scene({400, 64, 48, 9});
  s.shot.camera_t2 = s.shot.camera;
  for (const char* name : {"means", "quats", "scales"})
    s.p[name + std::string("_t2")] = s.p.at(name);
  for (const int mode : kModes) {
    s.shot.settings.transport = Transport(mode);
    DeviceScene device(queue, s);
    const FloatArrays images = device.forward();
    const Floats& alpha = images.at("alpha");
    const auto empty = std::count(alpha.begin(), alpha.end(), 0.f);
    double broken = 0;
    for (const auto& [name, gradient] : device.backward(random_cotangents(s, 9)))
      broken += count_not_finite(gradient);
    const std::string at = fmt::format("{}, drawn", mode_name(mode));
    rows.push_back({at + ", flow other than +0 in bits", count_not_plus_0(images.at("flow")), 0});
    rows.push_back({at + ", non-finite gradients", broken, 0});
    rows.push_back({at + ", share of empty pixels", double(empty) / double(s.pixels()), .5});
  }
}

Rows nothing_moved(Queue& queue) {  // T9
  Rows rows;
  DeviceMaths device(queue);
  for (const int mode : kModes) {
    double not_zero = 0, broken = 0;
    for (const double length : {.01, 1., 30., 1000.}) {
      Cases c = cases(length, 0, 9);
      c.m2 = c.m1;
      const DeviceMaths::Transported found = device.transport(mode, c.m1, c.m2, c.gh);
      // material has -0 in H, but the sum of a pixel's flow starts at +0 and stays +0.
      not_zero +=
          mode == TRANSPORT_MATERIAL
              ? double(found.h.size()) - double(std::count(found.h.begin(), found.h.end(), 0.f))
              : count_not_plus_0(found.h);
      broken += count_not_finite(found.v_m1) + count_not_finite(found.v_m2);
    }
    rows.push_back({fmt::format("{}, elements of H that are not {}", mode_name(mode),
                                mode == TRANSPORT_MATERIAL ? "0" : "+0"),
                    not_zero, 0});
    rows.push_back({mode_name(mode) + ", non-finite gradients", broken, 0});
  }
  drawn_static(queue, rows);
  return rows;
}

Rows small_motion(Queue& queue) {  // T10
  Rows rows;
  DeviceMaths device(queue);
  for (const int mode : {TRANSPORT_PAPER, TRANSPORT_OT, TRANSPORT_MATERIAL})
    for (const double length : {3., 30., 300.}) {
      const TransportErrors e = errors_of(device, mode, cases(length, 1e-4, 10));
      rows.push_back(
          {fmt::format("{}, {:.0f} px, 1e-4 of motion, H, worst", mode_name(mode), length),
           worst(e.h), 1e-4});
    }
  return rows;
}

Floats turned_by_90_degrees(const Floats& m) {  // rows (r1, r2) -> (-r2, r1)
  Floats t;
  for (size_t i = 0; i < m.size() / 6; ++i) {
    for (size_t k = 0; k < 3; ++k) t.push_back(-m[6 * i + 3 + k]);
    for (size_t k = 0; k < 3; ++k) t.push_back(m[6 * i + k]);
  }
  return t;
}

// Relative L2 difference between the flow of rotated splats at rotated pixels and the rotated flow.
double turn_error(DeviceMaths& device, int mode, const Cases& c) {
  Floats offsets, turned_offsets;  // d = inv(K) z, and rotated
  for (size_t i = 0; i < size_t(kCases); ++i) {
    const Whitening w = whiten(factor_at(c.m1, i));
    const float dx = float(w.u1 * double(c.z[12 * i]) + w.u2 * double(c.z[12 * i + 1]));
    const float dy = float(w.u3 * double(c.z[12 * i + 1]));
    offsets.insert(offsets.end(), {dx, dy});
    turned_offsets.insert(turned_offsets.end(), {-dy, dx});
  }
  const Floats t1 = turned_by_90_degrees(c.m1), t2 = turned_by_90_degrees(c.m2);
  const Floats h = device.transport(mode, c.m1, c.m2, c.gh).h;
  const Floats th = device.transport(mode, t1, t2, c.gh).h;
  const Floats z = device.whiten(c.m1, offsets).z, tz = device.whiten(t1, turned_offsets).z;
  double difference = 0, length = 0;
  for (size_t i = 0; i < size_t(kCases); ++i) {
    const float fx = h[4 * i] * z[2 * i] + h[4 * i + 1] * z[2 * i + 1];
    const float fy = h[4 * i + 2] * z[2 * i] + h[4 * i + 3] * z[2 * i + 1];
    const float gx = th[4 * i] * tz[2 * i] + th[4 * i + 1] * tz[2 * i + 1];
    const float gy = th[4 * i + 2] * tz[2 * i] + th[4 * i + 3] * tz[2 * i + 1];
    difference += std::pow(double(gx + fy), 2) + std::pow(double(gy - fx), 2);
    length += double(fx) * double(fx) + double(fy) * double(fy);
  }
  return std::sqrt(difference / length);
}

Rows frame_turn(Queue& queue) {  // T11
  Rows rows;
  DeviceMaths device(queue);
  for (const int mode : {TRANSPORT_PAPER, TRANSPORT_OT, TRANSPORT_MATERIAL})
    for (const auto& [length, width] : {std::pair{3., kThin}, {40., 8.}, {30., 1.}, {300., 1.}}) {
      const bool bound_by_z = mode == TRANSPORT_PAPER && length == 300;  // README.md
      rows.push_back({fmt::format("{}, {:g} x {:g} px turned by 90 degrees, relative L2",
                                  mode_name(mode), length, width),
                      turn_error(device, mode, cases(length, .2, 11, false, width)),
                      bound_by_z ? 1e-5 : 1e-6});
    }
  return rows;
}

// With T = I + H K: T S1 T = S2 and T = T^T. H from the device, the rest in double.
Rows monge_map(Queue& queue) {  // T15
  std::vector<double> pushed, symmetric;
  DeviceMaths device(queue);
  const Cases c = cases(62, .2, 15);  // (62 / .62)^2: kappa 1e4 after dilation
  const Floats h = device.transport(TRANSPORT_OT, c.m1, c.m2, c.gh).h;
  for (size_t i = 0; i < size_t(kCases); ++i) {
    const Whitening w1 = whiten(factor_at(c.m1, i)), w2 = whiten(factor_at(c.m2, i));
    Mat2 t = mat2_mul({h[4 * i], h[4 * i + 1], h[4 * i + 2], h[4 * i + 3]}, whitening_k(w1));
    t.a += 1;
    t.d += 1;
    const Sym2 s = sym2_congruence(t, w1.s);
    const double size = std::sqrt(sym2_inner(w2.s, w2.s));
    const Sym2 d = sym2_add(s, sym2_scale(w2.s, -1));
    pushed.push_back(std::sqrt(sym2_inner(d, d)) / size);
    symmetric.push_back(std::fabs(t.b - t.c) /
                        std::sqrt(t.a * t.a + t.b * t.b + t.c * t.c + t.d * t.d));
  }
  return {{"T S1 T = S2 at kappa 1e4, worst", worst(pushed), 1e-5},
          {"T symmetric at kappa 1e4, worst", worst(symmetric), 1e-5}};
}

}  // namespace

Tests transport_tests() {
  return {{"T7", "paper's flow of needles", true, paper},
          {"T8", "material flow of needles", true, material},
          {"T9", "no motion", true, nothing_moved},
          {"T10", "small motion", true, small_motion},
          {"T11", "turned image", true, frame_turn},
          {"T15", "Monge map", true, monge_map}};
}

}  // namespace gflow::stress
