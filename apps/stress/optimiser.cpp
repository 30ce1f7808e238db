// SPDX-License-Identifier: Apache-2.0
// T31-T33: Adam over ten thousand steps with spikes, non-finite gradients, and amplification of
// rounding noise.
#include <cstring>
#include <tuple>

#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/options/train_options.hpp"
#include "runtime/primitives/adam.hpp"
#include "shared/work.h"

namespace gflow::stress {
namespace {

// Adam as used for Gaussians, and for the shared parameters of paths: keys, bases, planes,
// networks.
const AdamOptions shipped;
const AdamConfig of_gaussians{shipped.beta1, shipped.beta2, true};
const AdamConfig of_paths{shipped.beta1_paths, shipped.beta2, false};

// Rows of 3 values with their optimiser.
struct Trained {
  Trained(Queue& queue, size_t rows, const AdamConfig& config = {})
      : queue(queue),
        rows(rows),
        adam(queue, config),
        group(queue, "values", rows, 3),
        state(queue, rows) {
    group.values.fill(queue, 0.f);
  }
  // Default `seen`: all rows.
  void step(const std::vector<float>& grads, AdamRate rate, std::vector<cl_uint> seen = {}) {
    seen.resize(rows, 1u);
    state.seen.write(queue, seen);
    group.grads.write(queue, grads);
    adam.refuse(queue, group, state, rows);
    adam.advance(queue, state, rows);
    adam.step(queue, group, state, rows, rate);
  }
  std::vector<float> values() { return group.values.read(queue); }

  Queue& queue;
  size_t rows;
  Adam adam;
  ParameterGroup group;
  RowState state;
};

size_t different_bits(const std::vector<float>& a, const std::vector<float>& b) {
  size_t count = a.size() == b.size() ? 0 : a.size() + b.size();
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    count += std::memcmp(&a[i], &b[i], sizeof(float)) != 0;
  return count;
}

// The largest difference between updating only rows with a gradient and updating all rows, with
// beta1 = 0: 300 steps of .01, each accurate to some roundings of v. Row i has a gradient in every
// (i + 1)-th step.
double left_out(Queue& queue) {
  constexpr size_t rows = 4 * ADAM_SPAN + 3, n = 3 * rows;
  Trained some(queue, rows, of_gaussians), all(queue, rows, of_gaussians);
  Random random(131);
  for (size_t t = 0; t < 300; ++t) {
    std::vector<cl_uint> seen(rows);
    std::vector<float> g(n, 0.f);
    for (size_t i = 0; i < n; ++i) {
      // Step 0 includes all rows, so that their step counts start together.
      seen[i / 3] = t % (i / 3 + 1) == 0;
      if (seen[i / 3]) g[i] = float(random.normal());
    }
    some.step(g, {.01f, 1e-8f}, seen);
    all.step(g, {.01f, 1e-8f});
  }
  const std::vector<float> found = some.values(), expected = all.values();
  double worst = 0;
  for (size_t i = 0; i < n; ++i)
    worst = worse(worst, std::fabs(double(found[i]) - double(expected[i])));
  return worst;
}

// The textbook update in double. The number of rows gives a CPU whole spans and a remainder.
void long_run(Queue& queue, const std::string& name, const AdamConfig& config, Rows& out) {
  constexpr size_t rows = 4 * ADAM_SPAN + 3, n = 3 * rows;
  constexpr int steps = 10000;
  const float lr = 1e-3f, epsilon = 1e-8f;
  const double b1 = double(config.beta1), b2 = double(config.beta2);
  Trained trained(queue, rows, config);
  std::vector<double> x(n, 0.), m(n, 0.), v(n, 0.);
  Random random(31);
  double b1t = 1, b2t = 1;
  for (int t = 1; t <= steps; ++t) {
    std::vector<float> g(n);
    for (size_t i = 0; i < n; ++i) {
      g[i] = float(.2 + random.normal());
      if (i % 3 == 1 && t % 1000 == 500) g[i] *= 1e6f;  // an occasional spike
      if (i % 3 == 2) g[i] *= 1e-6f;
    }
    trained.step(g, {lr, epsilon});
    b1t *= b1;
    b2t *= b2;
    for (size_t i = 0; i < n; ++i) {
      m[i] = b1 * m[i] + (1 - b1) * double(g[i]);
      v[i] = b2 * v[i] + (1 - b2) * double(g[i]) * double(g[i]);
      x[i] -= double(lr) * (m[i] / (1 - b1t)) / (std::sqrt(v[i] / (1 - b2t)) + double(epsilon));
    }
  }
  const std::vector<float> found = trained.values();
  double errors[3] = {0, 0, 0};
  for (size_t i = 0; i < n; ++i)
    errors[i % 3] = worse(errors[i % 3], std::fabs(double(found[i]) - x[i]) / std::fabs(x[i]));
  const char* const kinds[] = {"gradients of 1", "ten spikes of 1e6", "gradients of 1e-6"};
  for (size_t k = 0; k < 3; ++k)
    out.push_back({fmt::format("{}: 1e4 steps, {}, relative", name, kinds[k]), errors[k], 1e-4});
}

Rows long_runs(Queue& queue) {  // T31
  Rows out;
  long_run(queue, "tables' Adam", of_paths, out);
  long_run(queue, "Gaussians'", of_gaussians, out);

  Trained still(queue, 2);
  const std::vector<float> start{1.1f, -2.3f, 1e-20f, 3e10f, -0.f, .1f};
  still.group.values.write(queue, start);
  still.step(std::vector<float>(6, 0.f), {1, 1e-15f});
  out.push_back({"zero gradient, zero moments: changed values",
                 double(different_bits(still.values(), start)), 0});

  Trained seldom(queue, 2);  // row 1 is visible in every second step
  for (int t = 0; t < 9; ++t) {
    seldom.state.seen.write(queue, {1u, cl_uint(t % 2)});
    seldom.group.grads.fill(queue, .5f);
    seldom.adam.advance(queue, seldom.state, 2);
    seldom.adam.step(queue, seldom.group, seldom.state, 2, {.125f, 1e-15f});
  }
  const std::vector<cl_uint> made = seldom.state.steps.read(queue);
  out.push_back({"steps count from a row's first gradient: 9 and 7",
                 std::fabs(double(made[0]) - 9) + std::fabs(double(made[1]) - 7), 0});
  out.push_back({"share of zero-gradient steps skipped", left_out(queue), 3e-5});
  return out;
}

// Row 7 gets gradients in its last steps that are non-finite or have a non-finite square.
Rows bad_gradients(Queue& queue) {  // T32
  Rows out;
  constexpr size_t rows = 50, n = 3 * rows, culprit = 7;
  const auto run = [&](float poison, std::vector<cl_uint>* rejected) {
    Trained trained(queue, rows);
    Random random(32);
    for (int t = 0; t < 20; ++t) {
      std::vector<float> g(n);
      for (float& x : g) x = float(random.normal());
      if (t >= 10) g[3 * culprit + size_t(t) % 3] = poison;
      trained.step(g, {.01f, 1e-8f});
    }
    if (rejected) *rejected = trained.state.rejected.read(queue);
    return trained.values();
  };
  const std::vector<float> clean = run(.5f, nullptr);
  const float nan = std::nanf(""), inf = HUGE_VALF;
  for (const auto& [name, poison] :
       {std::pair{"NaN", nan}, {"inf", inf}, {"-inf", -inf}, {"3e19", 3e19f}}) {
    std::vector<cl_uint> rejected;
    std::vector<float> found = run(poison, &rejected);
    const double broken = count_not_finite(found);
    for (size_t k = 0; k < 3; ++k) found[3 * culprit + k] = clean[3 * culprit + k];
    out.push_back({fmt::format("{}: changed values of other rows", name),
                   double(different_bits(found, clean)), 0});
    out.push_back({fmt::format("{}: non-finite values", name), broken, 0});
    double wrong = 0;
    for (size_t i = 0; i < rows; ++i) wrong += (rejected[i] > 0) != (i == culprit);
    out.push_back({fmt::format("{}: rows wrongly rejected or accepted", name), wrong, 0});
  }
  return out;
}

// A gradient summed in float from 128 terms, forwards or backwards. The terms of every second value
// cancel, so that its gradient is only rounding noise. `size`: root mean square of the others, as
// in training (AdamOptions).
Rows noise_gain(Queue& queue) {  // T33
  constexpr size_t rows = 40, n = 3 * rows, terms = 128;
  const float lr = .01f;
  const auto run = [&](bool backwards, double size, float epsilon, const AdamConfig& config) {
    Trained trained(queue, rows, config);
    Random random(33);
    for (int t = 0; t < 100; ++t) {
      std::vector<float> g(n, 0.f);
      for (size_t i = 0; i < n; ++i) {
        float all[terms];
        for (size_t k = 0; k < terms; ++k) all[k] = float(size / 16 * random.normal());
        if (i % 2)
          for (size_t k = 0; k < terms / 2; ++k) all[terms / 2 + (k * 37) % (terms / 2)] = -all[k];
        for (size_t k = 0; k < terms; ++k) g[i] += all[backwards ? terms - 1 - k : k];
      }
      trained.step(g, {lr, epsilon});
    }
    return trained.values();
  };
  const auto largest_difference = [&](double size, float epsilon, const AdamConfig& config) {
    const std::vector<float> a = run(false, size, epsilon, config);
    const std::vector<float> b = run(true, size, epsilon, config);
    double most = 0;
    for (size_t i = 0; i < n; ++i) most = worse(most, std::fabs(double(a[i]) - double(b[i])));
    return most / double(lr);
  };
  Rows out;
  for (const auto& [name, size, epsilon, config] :
       {std::tuple{"means, 1e-5", 1e-5, shipped.eps_means, of_gaussians},
        {"turns, 2e-7", 2e-7, shipped.eps_quats, of_gaussians},
        {"scales, 3e-7", 3e-7, shipped.eps_scales, of_gaussians},
        {"opacities, 6e-7", 6e-7, shipped.eps_opacity, of_gaussians},
        {"colour, 8e-7", 8e-7, shipped.eps_sh, of_gaussians},
        {"times, 5e-8", 5e-8, shipped.eps_means, of_gaussians},
        {"hexplane's planes, 1.5e-7", 1.5e-7, shipped.eps_planes, of_paths},
        {"hexplane's planes, 2e-5", 2e-5, shipped.eps_planes, of_paths},
        {"hexplane's network, 4e-5", 4e-5, shipped.eps_network, of_paths},
        {"hexplane's network, 1e-2", 1e-2, shipped.eps_network, of_paths}})
    out.push_back({fmt::format("gradients as of {}: in learning-rate steps", name),
                   largest_difference(size, epsilon, config), 1});
  // Checks that the test can fail: with a tiny epsilon Adam amplifies the noise to whole steps.
  out.push_back({"epsilon 1e-15 instead: one step by the difference",
                 1 / largest_difference(1e-5, 1e-15f, of_paths), .2});
  return out;
}

}  // namespace

Tests optimiser_tests() {
  return {{"T31", "Adam, 10 000 steps", true, long_runs},
          {"T32", "non-finite gradients", true, bad_gradients},
          {"T33", "noise gain", true, noise_gain}};
}

}  // namespace gflow::stress
