// SPDX-License-Identifier: Apache-2.0
// The motion loss: motions of zero loss, the gradient against central differences, the device
// against double, needles and broken Gaussians, repeatability; and the choice of neighbours.
#include "optim/loss/motion_loss.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "optim/loss/nearest_points.hpp"
#include "optim/motion/spacetime.hpp"
#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {
namespace {

constexpr size_t MOVERS = 40;
constexpr double kExtent = 3;

// Gaussians at three times, in double: means [N, 3] and factors [N, 3, 3].
struct Moments {
  std::vector<double> means0, means1, means2, factors1, factors2;
};

Eigen::Vector3d eigen_row(const std::vector<double>& a, size_t i) {
  return {a[3 * i], a[3 * i + 1], a[3 * i + 2]};
}
Eigen::Matrix3d eigen_factor(const std::vector<double>& a, size_t i) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&a[9 * i]);
}
// Appends a vector, or a matrix row by row.
template <class Derived>
void put(std::vector<double>& a, const Eigen::MatrixBase<Derived>& m) {
  for (int r = 0; r < m.rows(); ++r)
    for (int c = 0; c < m.cols(); ++c) a.push_back(m(r, c));
}
Eigen::Matrix3d random_rotation(Random& random, double most) {
  return Eigen::AngleAxisd(most * random(), eigen(random.three()).normalized()).toRotationMatrix();
}
// R diag(s), sizes over two decades.
Eigen::Matrix3d random_factor(Random& random) {
  const Eigen::Vector3d log_scales = 2.3 * eigen(random.three());
  return random_rotation(random, 3) * log_scales.array().exp().matrix().asDiagonal();
}

Moments random_moments() {
  Random random(3);
  Moments m;
  for (size_t i = 0; i < MOVERS; ++i) {
    const Eigen::Vector3d mean = eigen(random.three());
    put(m.means1, mean);
    put(m.means0, mean + 0.1 * eigen(random.three()));
    put(m.means2, mean + 0.1 * eigen(random.three()));
    const Eigen::Matrix3d factor = random_factor(random);
    put(m.factors1, factor);
    put(m.factors2, random_rotation(random, 0.3) * factor);
  }
  return m;
}

// The pose at the second time is a rigid motion of the first.
Moments rigid_moments() {
  Random random(4);
  Moments m = random_moments();
  const Eigen::Matrix3d turn = random_rotation(random, 1);
  const Eigen::Vector3d shift(0.3, -0.2, 0.5);
  m.means2.clear();
  m.factors2.clear();
  for (size_t i = 0; i < MOVERS; ++i) {
    put(m.means2, turn * eigen_row(m.means1, i) + shift);
    put(m.factors2, turn * eigen_factor(m.factors1, i));
  }
  return m;
}

// Three pairs per Gaussian, each listed for both; distances are those at t1 unless `stretch` is
// set.
NeighbourPairs ring(const Moments& m, double stretch = 1) {
  NeighbourPairs pairs;
  pairs.offsets = {0};
  for (size_t i = 0; i < MOVERS; ++i) {
    for (const size_t step : {size_t(1), size_t(5), size_t(9)})
      for (const size_t j : {(i + step) % MOVERS, (i + MOVERS - step) % MOVERS}) {
        pairs.others.push_back(cl_uint(j));
        const double d = (eigen_row(m.means1, i) - eigen_row(m.means1, j)).norm();
        pairs.distances.push_back(float(stretch * d));
      }
    pairs.offsets.push_back(cl_uint(pairs.others.size()));
  }
  return pairs;
}

bool seen_row(size_t i) { return i % 4 != 3; }

MotionLossWeights only_term(float MotionLossWeights::*term) {
  MotionLossWeights w;
  w.extent = float(kExtent);
  w.neighbour_falloff = 2;
  w.*term = 0.7f;
  return w;
}
MotionLossWeights all_terms() {
  MotionLossWeights w = only_term(&MotionLossWeights::rigidity);
  w.rotation = 0.1f;
  w.isometry = 0.5f;
  w.velocity = 0.3f;
  w.acceleration = 0.9f;
  return w;
}

double rho(double square, double knee) { return std::sqrt(square + knee * knee) - knee; }

// The loss as defined in its header, by Eigen.
double plain_loss(const MotionLossWeights& w, const NeighbourPairs& pairs, const Moments& m) {
  const double knee = 1e-3 * double(w.extent), extent = double(w.extent);
  std::vector<Eigen::Matrix3d> turns;
  for (size_t i = 0; i < MOVERS; ++i) {
    const auto rotation = [&](const std::vector<double>& factors) {
      Eigen::Matrix3d axes = eigen_factor(factors, i);
      for (int k = 0; k < 3; ++k) axes.col(k).normalize();
      return axes;
    };
    turns.push_back(rotation(m.factors1) * rotation(m.factors2).inverse());
  }
  std::vector<float> distances = pairs.distances;
  std::sort(distances.begin(), distances.end());
  const double median = double(distances[distances.size() / 2]);
  double sum = 0, bends = 0;
  for (cl_uint i = 0; i < MOVERS; ++i)
    for (size_t k = pairs.offsets[i]; k < pairs.offsets[i + 1]; ++k) {
      const cl_uint j = pairs.others[k];
      if (i > j || !seen_row(i) || !seen_row(j)) continue;
      const Eigen::Vector3d d1 = eigen_row(m.means1, j) - eigen_row(m.means1, i);
      const Eigen::Vector3d d2 = eigen_row(m.means2, j) - eigen_row(m.means2, i);
      const double l = double(pairs.distances[k]);
      const double weight = std::exp(-double(w.neighbour_falloff) * l * l / (median * median));
      const double rigidity = 0.5 * (rho((d1 - turns[i] * d2).squaredNorm(), knee) +
                                     rho((d1 - turns[j] * d2).squaredNorm(), knee));
      const double isometry = 0.5 * (rho((d1.norm() - l) * (d1.norm() - l), knee) +
                                     rho((d2.norm() - l) * (d2.norm() - l), knee));
      const double velocity = rho((d2 - d1).squaredNorm(), knee);
      const double rotation = rho((turns[i] - turns[j]).squaredNorm(), 0.01);
      sum += weight *
             (double(w.rigidity) * rigidity / extent + double(w.rotation) * rotation +
              double(w.isometry) * isometry / extent + double(w.velocity) * velocity / extent);
    }
  for (size_t i = 0; i < MOVERS; ++i)
    if (seen_row(i))
      bends += rho((eigen_row(m.means0, i) - 2 * eigen_row(m.means1, i) + eigen_row(m.means2, i))
                       .squaredNorm(),
                   knee);
  return sum / (0.5 * double(pairs.others.size())) +
         double(w.acceleration) * bends / (extent * MOVERS);
}

// Gradients of `plain_loss` by central differences, in the order of the fields of Moments.
std::vector<std::vector<double>> plain_gradients(const MotionLossWeights& w,
                                                 const NeighbourPairs& pairs, const Moments& m) {
  std::vector<std::vector<double>> all;
  for (auto field : {&Moments::means0, &Moments::means1, &Moments::means2, &Moments::factors1,
                     &Moments::factors2}) {
    Moments moved = m;
    all.push_back(numeric_gradient(
        [&](const std::vector<double>& x) {
          moved.*field = x;
          return plain_loss(w, pairs, moved);
        },
        m.*field, 1e-6));
  }
  return all;
}

struct MotionResult {
  std::vector<std::vector<float>> gradients;  // as plain_gradients
  MotionLossValue value;
};

MotionResult run(Queue& queue, const MotionLossWeights& w, const NeighbourPairs& pairs,
                 const Moments& m) {
  MotionLoss loss(queue, w);
  loss.set_pairs(queue, pairs);
  const auto at = [&](const std::vector<double>& means, const std::vector<double>& factors) {
    GaussiansAt g;
    g.ensure(queue, MOVERS);
    g.means.write(queue, to_float(means));
    g.factors.write(queue, to_float(factors));
    return g;
  };
  std::vector<cl_uint> seen;
  for (size_t i = 0; i < MOVERS; ++i) seen.push_back(seen_row(i) ? 2 : 0);
  const GaussiansAt t0 = at(m.means0, m.factors1), t1 = at(m.means1, m.factors1);
  const GaussiansAt t2 = at(m.means2, m.factors2);
  GaussianGradients v;
  v.ensure(queue, MOVERS);
  v.v_means_t0.ensure(queue, 3 * MOVERS);
  for (Buffer<float>* b : {&v.v_means, &v.v_factors, &v.v_means_t2, &v.v_factors_t2, &v.v_means_t0})
    b->fill(queue, 0);
  loss.run(queue, Buffer<cl_uint>(queue, seen, "seen"), &t0, t1, t2, v);
  return {{v.v_means_t0.read(queue), v.v_means.read(queue), v.v_means_t2.read(queue),
           v.v_factors.read(queue), v.v_factors_t2.read(queue)},
          loss.value(queue)};
}

TEST(MotionLoss, IsThePlainFormulaWithItsCentralDifferencesForEachTermAlone) {
  Queue queue = test_queue();
  const Moments m = random_moments();
  const NeighbourPairs pairs = ring(m, 1.1);
  for (const auto term :
       {&MotionLossWeights::rigidity, &MotionLossWeights::rotation, &MotionLossWeights::isometry,
        &MotionLossWeights::velocity, &MotionLossWeights::acceleration}) {
    const MotionLossWeights w = only_term(term);
    const MotionResult found = run(queue, w, pairs, m);
    const double value = plain_loss(w, pairs, m);
    EXPECT_GT(value, 1e-3);
    EXPECT_NEAR(found.value.total(), value, 1e-6 * value);
    const auto expected = plain_gradients(w, pairs, m);
    for (size_t k = 0; k < expected.size(); ++k)
      EXPECT_LT(relative_l2(found.gradients[k], expected[k]), 1e-5) << k;
  }
}

TEST(MotionLoss, OfAllTermsIsTheSum) {
  Queue queue = test_queue();
  const Moments m = random_moments();
  const NeighbourPairs pairs = ring(m, 0.9);
  const MotionResult found = run(queue, all_terms(), pairs, m);
  EXPECT_NEAR(found.value.total(), plain_loss(all_terms(), pairs, m), 1e-6);
  const auto expected = plain_gradients(all_terms(), pairs, m);
  for (size_t k = 0; k < expected.size(); ++k) {
    EXPECT_GT(norm(expected[k]), 0);
    EXPECT_LT(relative_l2(found.gradients[k], expected[k]), 1e-5) << k;
  }
}

// One Gaussian of a pair from 24 numbers: its means and factors at t1 and t2.
struct FromNumbers {
  explicit FromNumbers(const double* x) {
    const auto rows = [](const double* a) {
      return Mat3{{a[0], a[1], a[2]}, {a[3], a[4], a[5]}, {a[6], a[7], a[8]}};
    };
    turn = relative_rotation(rows(x + 6), rows(x + 15));
    mover = {{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, turn.t};
  }
  Turn turn;
  PairMember mover;
};

// The kernel's source in double, for any factors: differences are accurate to 1e-6.
TEST(MotionLoss, OfOnePairHasTheGradientOfItsDifferences) {
  Random random(8);
  const MotionLossRule rule{0.7f, 0.4f, 0.6f, 0.5f, 0, 0.05f};
  const auto share = [&](const std::vector<double>& x, size_t who) {
    const FromNumbers a(&x[24 * who]), b(&x[24 * (1 - who)]);
    return pair_share(rule, 0.8, 1.3, a.mover, b.mover);
  };
  const auto loss = [&](const std::vector<double>& x) {
    double sum = 0;
    for (const size_t who : {0, 1}) {
      const PairTerms terms = share(x, who).terms;
      sum += terms.rigidity + terms.rotation + terms.isometry + terms.velocity;
    }
    return sum;
  };
  for (int round = 0; round < 20; ++round) {
    std::vector<double> x(48);
    for (double& value : x) value = random();
    for (const size_t first : {6, 15, 30, 39})  // diagonals keep the columns far from one plane
      for (const size_t k : {0, 4, 8}) x[first + k] += 2;
    const PairMember v = share(x, 0).gradient;
    const TurnGradient g = turn_vjp(FromNumbers(x.data()).turn, v.turn);
    std::vector<double> found = {v.mean1.x, v.mean1.y, v.mean1.z, v.mean2.x, v.mean2.y, v.mean2.z};
    for (const Mat3& factor : {g.factor1, g.factor2}) put(found, eigen(factor));
    std::vector<double> expected = numeric_gradient(loss, x, 1e-5);
    expected.resize(24);  // gradients of the first Gaussian
    EXPECT_TRUE(all_close(found, expected, {1e-6, 1e-8}));
  }
}

TEST(MotionLoss, OfARigidMotionOfEverythingIsNothing) {
  Queue queue = test_queue();
  const Moments m = rigid_moments();
  MotionLossWeights w = all_terms();
  w.velocity = w.acceleration = 0;  // these depend on rotation
  const MotionResult found = run(queue, w, ring(m), m);
  EXPECT_LT(found.value.total(), 1e-8);
  for (const auto& gradient : found.gradients) EXPECT_LT(norm(gradient), 1e-4);
  w.velocity = 1;
  EXPECT_GT(run(queue, w, ring(m), m).value.velocity, 1e-2);
}

TEST(MotionLoss, DoesNotChangeWhenTheWorldIsTurned) {
  Queue queue = test_queue();
  Random random(6);
  const Moments m = random_moments();
  const Eigen::Matrix3d turn = random_rotation(random, 3);
  Moments turned;
  for (size_t i = 0; i < MOVERS; ++i) {
    put(turned.means0, turn * eigen_row(m.means0, i));
    put(turned.means1, turn * eigen_row(m.means1, i));
    put(turned.means2, turn * eigen_row(m.means2, i));
    put(turned.factors1, turn * eigen_factor(m.factors1, i));
    put(turned.factors2, turn * eigen_factor(m.factors2, i));
  }
  const MotionLossValue a = run(queue, all_terms(), ring(m, 1.1), m).value;
  const MotionLossValue b = run(queue, all_terms(), ring(m, 1.1), turned).value;
  EXPECT_NEAR(a.rigidity, b.rigidity, 1e-6 * a.rigidity);
  EXPECT_NEAR(a.rotation, b.rotation, 1e-6 * a.rotation);
  EXPECT_NEAR(a.isometry, b.isometry, 1e-6 * a.isometry);
  EXPECT_NEAR(a.velocity, b.velocity, 1e-6 * a.velocity);
  EXPECT_NEAR(a.acceleration, b.acceleration, 1e-6 * a.acceleration);
}

TEST(MotionLoss, OfATurnDoesNotDependOnScales) {
  Random random(9);
  for (int round = 0; round < 20; ++round) {
    const Eigen::Matrix3d r1 = random_rotation(random, 3), r2 = random_rotation(random, 3);
    const auto rows = [](const Eigen::Matrix3d& m) {
      return Mat3{
          {m(0, 0), m(0, 1), m(0, 2)}, {m(1, 0), m(1, 1), m(1, 2)}, {m(2, 0), m(2, 1), m(2, 2)}};
    };
    const Turn turn = relative_rotation(rows(r1 * Eigen::Vector3d(1e-6, 2, 1e-3).asDiagonal()),
                                        rows(r2 * Eigen::Vector3d(5, 1e-5, 1).asDiagonal()));
    EXPECT_TRUE(turn.known);
    EXPECT_LT((eigen(turn.t) - r1 * r2.transpose()).norm(), 1e-12);
  }
}

// Needles, flat and vanished Gaussians and non-finite values: gradients are finite, and those of
// the others are as if the broken Gaussian had no pairs.
TEST(MotionLoss, OfBrokenGaussiansHarmsNoOther) {
  Queue queue = test_queue();
  const double nan = std::numeric_limits<double>::quiet_NaN(), huge = 1e30;
  Moments m = random_moments();
  const auto scale = [&](size_t i, const Eigen::Vector3d& by) {
    for (auto field : {&Moments::factors1, &Moments::factors2}) {
      const Eigen::Matrix3d f = eigen_factor(m.*field, i) * by.asDiagonal();
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) (m.*field)[9 * i + size_t(3 * r + c)] = f(r, c);
    }
  };
  scale(0, {1e-12, 1, 1e4});
  scale(1, {1e-30, 1, 1});
  scale(2, {0, 0, 0});
  scale(4, {huge, 1, 1});
  m.factors2[9 * 5 + 4] = nan;
  Moments broken = m;
  broken.means1[3 * 12] = nan;
  broken.means2[3 * 12 + 1] = huge;
  const NeighbourPairs pairs = ring(random_moments());
  const MotionResult found = run(queue, all_terms(), pairs, broken);
  for (const auto& gradient : found.gradients)
    for (const float g : gradient) EXPECT_TRUE(std::isfinite(g));
  EXPECT_TRUE(std::isfinite(found.value.total()));
  MotionResult whole = run(queue, all_terms(), pairs, m);
  for (const size_t i : {size_t(0), size_t(20), size_t(30)})  // not neighbours of 12
    for (size_t k = 0; k < 3; ++k)
      EXPECT_EQ(found.gradients[1][3 * i + k], whole.gradients[1][3 * i + k]);
}

TEST(MotionLoss, OfWhatIsNotSeenIsNothingAndTheSameBitsComeTwice) {
  Queue queue = test_queue();
  const Moments m = random_moments();
  const MotionResult first = run(queue, all_terms(), ring(m, 1.1), m);
  const MotionResult second = run(queue, all_terms(), ring(m, 1.1), m);
  EXPECT_EQ(first.gradients, second.gradients);
  EXPECT_EQ(first.value.total(), second.value.total());
  for (size_t i = 0; i < MOVERS; ++i)
    if (!seen_row(i)) {
      EXPECT_EQ(first.gradients[1][3 * i], 0);
    }
}

TEST(MotionLoss, RefusesNeighboursOfOthers) {
  Queue queue = test_queue();
  NeighbourPairs pairs = ring(random_moments());
  pairs.offsets.pop_back();
  EXPECT_THROW(run(queue, all_terms(), pairs, random_moments()), Error);
  MotionLossWeights w;
  w.extent = 0;
  EXPECT_THROW(MotionLoss(queue, w), Error);
}

// Random Gaussians that exist at two times, far from each other, and one that never exists.
struct Lives {
  explicit Lives(Queue& queue) : motion(queue, 0.05f), p(queue, MOVERS, motion.groups()) {
    Random random(21);
    for (ParameterGroup& group : p.groups) group.values.fill(queue, 0);
    std::vector<float> means, means_t, log_scales, quats;
    for (size_t i = 0; i < MOVERS; ++i) {
      for (int c = 0; c < 3; ++c) means.push_back(float(random()));
      means_t.push_back(i % 2 ? 0.2f : 0.8f);
      log_scales.insert(log_scales.end(), {-3, -3, -3, std::log(0.05f)});
      quats.insert(quats.end(), {1, 0, 0, 0});
    }
    means_t[7] = 50;
    p["means"].values.write(queue, means);
    p["means_t"].values.write(queue, means_t);
    p["log_scales"].values.write(queue, log_scales);
    p["quats"].values.write(queue, quats);
    xyz = means;
  }
  static bool together(size_t i, size_t j) { return i % 2 == j % 2 && i != 7 && j != 7; }
  SpacetimeMotion motion;
  Parameters p;
  std::vector<float> xyz;
};

TEST(NeighbourPairs, AreTheNearestAmongThoseThereAtTheSameTime) {
  Queue queue = test_queue();
  Lives lives(queue);
  NeighbourRule rule;
  rule.count = 3;
  rule.moments = 10;
  const NeighbourPairs pairs = find_neighbours(queue, lives.p, lives.motion, rule);
  const auto distance = [&](size_t i, size_t j) {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      sum += std::pow(double(lives.xyz[3 * i + c]) - double(lives.xyz[3 * j + c]), 2);
    return std::sqrt(sum);
  };
  // Whether fewer than `count` others are nearer to i than j.
  const auto chosen = [&](size_t i, size_t j) {
    size_t nearer = 0;
    for (size_t k = 0; k < MOVERS; ++k)
      nearer += k != i && k != j && Lives::together(i, k) && distance(i, k) < distance(i, j);
    return Lives::together(i, j) && i != j && nearer < rule.count;
  };
  ASSERT_EQ(pairs.offsets.size(), MOVERS + 1);
  for (cl_uint i = 0; i < MOVERS; ++i) {
    std::vector<cl_uint> expected;
    for (cl_uint j = 0; j < MOVERS; ++j)
      if (chosen(i, j) || chosen(j, i)) expected.push_back(j);
    const std::vector<cl_uint> found(pairs.others.begin() + pairs.offsets[i],
                                     pairs.others.begin() + pairs.offsets[i + 1]);
    EXPECT_EQ(found, expected) << i;
    for (size_t k = pairs.offsets[i]; k < pairs.offsets[i + 1]; ++k)
      EXPECT_NEAR(double(pairs.distances[k]), distance(i, pairs.others[k]), 1e-6);
  }
}

TEST(NeighbourPairs, OfOneGaussianOrManyInOnePlaceExist) {
  Queue queue = test_queue();
  Lives lives(queue);
  lives.p["means"].values.fill(queue, 1);
  NeighbourRule rule;
  const NeighbourPairs pairs = find_neighbours(queue, lives.p, lives.motion, rule);
  for (const float d : pairs.distances) EXPECT_EQ(d, 0);
  Parameters one(queue, 1, lives.motion.groups());
  for (ParameterGroup& group : one.groups) group.values.fill(queue, 0);
  EXPECT_TRUE(find_neighbours(queue, one, lives.motion, rule).others.empty());
}

TEST(NeighbourPairs, GoThroughACheckpointAndDamagedOnesAreRefused) {
  const NeighbourPairs pairs = ring(random_moments());
  Arrays arrays;
  save_state(pairs, arrays);
  const NeighbourPairs back = load_neighbours(arrays, MOVERS, "c.npz");
  EXPECT_EQ(back.offsets, pairs.offsets);
  EXPECT_EQ(back.others, pairs.others);
  EXPECT_EQ(back.distances, pairs.distances);
  EXPECT_THROW(load_neighbours(arrays, MOVERS + 1, "c.npz"), Error);
  NeighbourPairs outside = pairs;
  outside.others[3] = MOVERS;
  save_state(outside, arrays);
  EXPECT_THROW(load_neighbours(arrays, MOVERS, "c.npz"), Error);
  EXPECT_THROW(load_neighbours({}, MOVERS, "c.npz"), Error);
}

TEST(NearestPoints, AreAtMostAsManyAsThereAre) {
  const std::vector<float> xyz = {0, 0, 0, 3, 0, 0, 1, 0, 0};
  NearestPoints tree(xyz);
  const auto& near = tree.of(xyz.data(), 5);
  ASSERT_EQ(near.size(), 3u);
  EXPECT_EQ(near[1].index, 2u);
  EXPECT_EQ(near[2].squared, 9);
}

}  // namespace
}  // namespace gflow
