// SPDX-License-Identifier: Apache-2.0
// Derivatives of the losses on motion: the kernels' shared source in double.
#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/loss/motion_loss.hpp"
#include "optim/reference/flat_static.hpp"

namespace gflow::stress {
namespace {

constexpr size_t kMovers = 17;

struct Moments {
  std::vector<double> means1, means2, factors1, factors2;
};
PairMember mover_of(const Moments& m, size_t i, Turn& turn) {
  turn = relative_rotation(reference::rows9(m.factors1, i), reference::rows9(m.factors2, i));
  return {reference::row3(m.means1, i), reference::row3(m.means2, i), turn.t};
}

// Gaussians that move by a tenth and rotate by some degrees.
Moments some_moments() {
  Random random(55);
  Moments m;
  for (size_t i = 0; i < kMovers; ++i) {
    const Mat3 l = factor_of(
        {1 + random.normal(), random.normal(), random.normal(), random.normal()}, {.5, .8, 1.2});
    const Mat3 turn = quat_to_rotmat(
        quat_normalize({1, .1 * random.normal(), .1 * random.normal(), .1 * random.normal()}).q);
    for (const auto& [factor, out] : {std::pair{l, &m.factors1}, {mat3_mul(turn, l), &m.factors2}})
      for (const real3 row : {factor.r1, factor.r2, factor.r3})
        for (const double x : {row.x, row.y, row.z}) out->push_back(double(float(x)));
    for (int k = 0; k < 3; ++k) {
      m.means1.push_back(double(float(random.normal())));
      m.means2.push_back(double(float(m.means1.back() + .1 * random.normal())));
    }
  }
  return m;
}

// Each Gaussian with its predecessor and successor; distances a tenth larger than the real ones.
NeighbourPairs ring_of_pairs(const Moments& m) {
  NeighbourPairs pairs;
  pairs.offsets = {0};
  for (size_t i = 0; i < kMovers; ++i) {
    for (const size_t j : {(i + 1) % kMovers, (i + kMovers - 1) % kMovers}) {
      const real3 d = reference::row3(m.means1, i) - reference::row3(m.means1, j);
      pairs.others.push_back(cl_uint(j));
      pairs.distances.push_back(float(1.1 * std::sqrt(dot(d, d))));
    }
    pairs.offsets.push_back(cl_uint(pairs.others.size()));
  }
  return pairs;
}

// The loss and its gradient in double, pair by pair.
class PairsInDouble {
 public:
  PairsInDouble(const MotionLossRule& rule, const NeighbourPairs& pairs)
      : rule_(rule), pairs_(pairs) {}

  double loss(const Moments& x) const {
    double sum = 0;
    for (size_t i = 0; i < kMovers; ++i)
      for (size_t k = pairs_.offsets[i]; k < pairs_.offsets[i + 1]; ++k) {
        Turn own;
        const PairTerms t = share(x, mover_of(x, i, own), k).terms;
        sum += t.rigidity + t.rotation + t.isometry + t.velocity;
      }
    return sum;
  }
  Moments gradient(const Moments& x) const {
    Moments v{std::vector<double>(3 * kMovers), std::vector<double>(3 * kMovers),
              std::vector<double>(9 * kMovers), std::vector<double>(9 * kMovers)};
    for (size_t i = 0; i < kMovers; ++i) {
      Turn own;
      const PairMember a = mover_of(x, i, own);
      Mat3 by_turn = mat3_scale(mat3_identity(), 0);
      for (size_t k = pairs_.offsets[i]; k < pairs_.offsets[i + 1]; ++k) {
        const PairMember by = share(x, a, k).gradient;
        reference::add_row3(v.means1, i, by.mean1);
        reference::add_row3(v.means2, i, by.mean2);
        by_turn = mat3_add(by_turn, by.turn);
      }
      const TurnGradient g = turn_vjp(own, by_turn);
      reference::add_rows9(v.factors1, i, g.factor1);
      reference::add_rows9(v.factors2, i, g.factor2);
    }
    return v;
  }

 private:
  PairShare share(const Moments& x, const PairMember& own, size_t pair) const {
    Turn other;
    return pair_share(rule_, 1, double(pairs_.distances[pair]), own,
                      mover_of(x, pairs_.others[pair], other));
  }

  MotionLossRule rule_;
  const NeighbourPairs& pairs_;
};

Derivative motion_loss_row(Queue& queue) {
  const Moments m = some_moments();
  const NeighbourPairs pairs = ring_of_pairs(m);
  MotionLossWeights w;
  w.rigidity = .7f;
  w.rotation = .1f;
  w.isometry = .5f;
  w.velocity = .3f;
  w.extent = 3;
  w.neighbour_falloff = 0;  // all pairs have equal weight
  const double pair_count = double(pairs.others.size()) / 2, knee = 1e-3 * 3;
  const PairsInDouble in_double(
      {float(double(w.rigidity) / 3 / pair_count), float(double(w.rotation) / pair_count),
       float(double(w.isometry) / 3 / pair_count), float(double(w.velocity) / 3 / pair_count), 0,
       float(knee)},
      pairs);
  const Moments expected = in_double.gradient(m);

  GaussiansAt t1, t2;
  t1.ensure(queue, kMovers);
  t2.ensure(queue, kMovers);
  t1.means.write(queue, to_float(m.means1));
  t2.means.write(queue, to_float(m.means2));
  t1.factors.write(queue, to_float(m.factors1));
  t2.factors.write(queue, to_float(m.factors2));
  GaussianGradients v;
  v.zero(queue, kMovers);
  MotionLoss device(queue, w);
  device.set_pairs(queue, pairs);
  device.run(queue, Buffer<cl_uint>(queue, std::vector<cl_uint>(kMovers, 1u), "seen"), nullptr, t1,
             t2, v);
  double to_double = 0, differences = 0;
  const auto add = [&](std::vector<double> Moments::*field, const Buffer<float>& gradient) {
    Moments moved = m;
    const auto loss = [&](const std::vector<double>& x) {
      moved.*field = x;
      return in_double.loss(moved);
    };
    to_double = worse(to_double, relative_error(gradient.read(queue), expected.*field));
    differences = worse(differences, relative_error(expected.*field, slopes(loss, m.*field, 1e-5)));
  };
  add(&Moments::means1, v.v_means);
  add(&Moments::means2, v.v_means_t2);
  add(&Moments::factors1, v.v_factors);
  add(&Moments::factors2, v.v_factors_t2);
  return {"motion_pairs", "means, factors at t1, t2", to_double, differences, 1e-4, 1e-6};
}

Derivative bends_row(Queue& queue) {
  Random random(56);
  std::vector<double> x;  // means at t0, at t1, at t2
  for (size_t i = 0; i < 9 * kMovers; ++i) x.push_back(double(float(random.normal())));
  MotionLossWeights w;
  w.acceleration = .8f;
  w.extent = 3;
  const MotionLossRule rule{0, 0, 0, 0, float(.8 / 3 / kMovers), float(1e-3 * 3)};
  const auto bend = [&](const std::vector<double>& y, size_t i) {
    return acceleration_loss(rule, reference::row3(y, i), reference::row3(y, kMovers + i),
                             reference::row3(y, 2 * kMovers + i));
  };
  std::vector<double> expected(x.size());
  for (size_t i = 0; i < kMovers; ++i)
    for (size_t time = 0; time < 3; ++time)
      reference::add_row3(expected, time * kMovers + i,
                          bend(x, i).gradient * (time == 1 ? -2. : 1.));
  const auto loss = [&](const std::vector<double>& y) {
    double sum = 0;
    for (size_t i = 0; i < kMovers; ++i) sum += bend(y, i).value;
    return sum;
  };
  GaussiansAt at[3];
  for (size_t time = 0; time < 3; ++time) {
    at[time].ensure(queue, kMovers);
    const auto from = x.begin() + long(3 * kMovers * time);
    at[time].means.write(queue, std::vector<float>(from, from + 3 * kMovers));
  }
  GaussianGradients v;
  v.zero(queue, kMovers);
  v.v_means_t0.ensure(queue, 3 * kMovers);
  v.v_means_t0.fill(queue, 0);
  MotionLoss device(queue, w);
  device.run(queue, Buffer<cl_uint>(queue, std::vector<cl_uint>(kMovers, 1u), "seen"), &at[0],
             at[1], at[2], v);
  std::vector<float> found;
  for (const Buffer<float>* gradient : {&v.v_means_t0, &v.v_means, &v.v_means_t2})
    for (const float y : gradient->read(queue)) found.push_back(y);
  return {"motion_acceleration",
          "means at t0, t1, t2",
          relative_error(found, expected),
          relative_error(expected, slopes(loss, x, 1e-4)),
          1e-4,
          1e-6};
}

}  // namespace

std::vector<Derivative> motion_loss_derivatives(Queue& queue) {
  return {motion_loss_row(queue), bends_row(queue)};
}

}  // namespace gflow::stress
