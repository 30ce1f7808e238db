// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/gradient_check.hpp"

#include <cmath>

#include "optim/motion/spacetime.hpp"
#include "shared/motion/spacetime.h"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kCount = 64;
constexpr float kTime = 0.3f;

// Uniform values in [-1, 1]; each stream is another array.
std::vector<float> numbers(uint stream, size_t n) {
  std::vector<float> values(n);
  for (size_t i = 0; i < n; ++i) values[i] = float(2 * random_uniform(1, stream, uint(i)) - 1);
  return values;
}

real3 at3(const std::vector<float>& v, size_t i) {
  return make_real3(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
}
real4 at4(const std::vector<float>& v, size_t i) {
  return make_real4(v[4 * i], v[4 * i + 1], v[4 * i + 2], v[4 * i + 3]);
}

}  // namespace

SelfCheckRow gradient_check(Queue& queue) {
  SpacetimeMotion motion(queue, 0);
  Parameters p(queue, kCount, motion.groups());
  std::map<std::string, std::vector<float>> values;
  for (size_t g = 0; g < p.specs.size(); ++g) {
    values[p.specs[g].name] = numbers(uint(g), kCount * p.specs[g].width);
    p.groups[g].values.write(queue, values[p.specs[g].name]);
  }
  const std::vector<float> v_means = numbers(50, 3 * kCount), v_factors = numbers(51, 9 * kCount);
  const std::vector<float> v_opacities = numbers(52, kCount);
  const Buffer<cl_uint> touched(queue, std::vector<cl_uint>(kCount, 1u), "touched");
  motion.backward(queue, p, kTime, true, touched, Buffer<float>(queue, v_means, "v_means"),
                  Buffer<float>(queue, v_factors, "v_factors"),
                  Buffer<float>(queue, v_opacities, "v_opacities"));
  const std::vector<float> quats = p["quats"].grads.read(queue);
  const std::vector<float> turns = p["turns"].grads.read(queue);
  const std::vector<float> log_scales = p["log_scales"].grads.read(queue);

  double error = 0, norm = 0;
  const auto compare = [&](real4 expected, real4 found) {
    const real4 d = found - expected;
    error += dot(d, d);
    norm += dot(expected, expected);
  };
  for (size_t i = 0; i < kCount; ++i) {
    Spacetime g;
    g.mean = at3(values["means"], i);
    g.mean_t = values["means_t"][i];
    g.velocity = at3(values["velocities"], i);
    g.half_acceleration = at3(values["half_accelerations"], i);
    g.quat = at4(values["quats"], i);
    g.turn = at4(values["turns"], i);
    g.log_scales = at4(values["log_scales"], i);
    g.logit_opacity = values["logit_opacities"][i];
    Mat3 v_factor;
    v_factor.r1 = at3(v_factors, 3 * i);
    v_factor.r2 = at3(v_factors, 3 * i + 1);
    v_factor.r3 = at3(v_factors, 3 * i + 2);
    const Spacetime v = spacetime_vjp(g, kTime, at3(v_means, i), v_factor, v_opacities[i]);
    compare(v.quat, at4(quats, i));
    compare(v.turn, at4(turns, i));
    compare(v.log_scales, at4(log_scales, i));
  }
  const double relative = norm > 0 ? std::sqrt(error / norm) : 1;
  return self_check_row("gradient against double, relative", std::isfinite(relative) ? relative : 1,
                        1e-4);
}

SelfCheck full_self_check(Queue& queue) {
  SelfCheck rows = self_check(queue);
  rows.push_back(gradient_check(queue));
  return rows;
}

}  // namespace gflow
