// SPDX-License-Identifier: Apache-2.0
#include "optim/density/mcmc.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "optim/motion/models.hpp"
#include "shared/relocation.h"
#include "tests/support/compare.hpp"
#include "tests/support/density_rule.hpp"
#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

// Rows are marked: means, colours and temporal means of row i contain i. The video lasts from 0
// to 1.
class McmcField {
 public:
  explicit McmcField(const std::vector<float>& opacities, MotionModelKind kind = {})
      : queue(test_queue()),
        density(queue),
        motion(make_motion(queue, shape_of(kind))),
        parameters(queue, opacities.size(), all_groups(), motion->tables()) {
    rule.prune_opacity = 0.02f;
    rule.growth = 0;
    for (Table* table : parameters.tables())
      for (ParameterGroup& group : table->groups) {
        std::vector<float> own(table->count * group.width);
        for (size_t i = 0; i < own.size(); ++i)
          own[i] = float(i / group.width % std::max<size_t>(parameters.count, 1));
        group.values.write(queue, own);
        group.remember(queue);
        group.exp_avg.write(queue, own);
        group.exp_avg_sq.write(queue, own);
      }
    std::vector<float> logits;
    for (const float o : opacities) logits.push_back(logit(o));
    parameters["logit_opacities"].values.write(queue, logits);
    parameters["log_scales"].values.fill(queue, -1);
    parameters["means_t"].values.fill(queue, 0.5f);
    parameters.rows.steps.fill(queue, 9u);
  }

  void refine(uint32_t seed = 1) { density.refine(queue, parameters, *motion, rule, seed); }
  std::vector<float> values(const std::string& name) { return parameters[name].values.read(queue); }
  std::vector<int> sources() {
    std::vector<int> rows;
    for (const float m : values("mark")) rows.push_back(int(m));
    return rows;
  }
  // Number of rows that originate from each row.
  std::vector<int> numbers(size_t n) {
    std::vector<int> counts(n);
    for (const int row : sources()) ++counts[size_t(row)];
    return counts;
  }

  Queue queue;
  McmcDensity density;
  DensityRule rule = quiet_rule();
  std::unique_ptr<Motion> motion;
  Parameters parameters;

 private:
  static MotionShape shape_of(MotionModelKind kind) {
    MotionShape shape;
    shape.motion = kind;
    shape.hexplane.times = 16;
    shape.keys = 3;
    return shape;
  }
  std::vector<GroupSpec> all_groups() const {
    std::vector<GroupSpec> groups = motion->groups();
    groups.push_back({"mark", 1});
    return groups;
  }
};

TEST(Mcmc, WhatIsAliveStaysToTheBit) {
  McmcField field({0.5f, 0.03f, 0.9f});
  const auto before = field.values("logit_opacities");
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(field.values("logit_opacities"), before);
  EXPECT_EQ(field.parameters.rows.steps.read(field.queue), (std::vector<cl_uint>{9, 9, 9}));
}

TEST(Mcmc, TheFaintTheNeverVisibleAndTheBrokenMoveToTheLive) {
  McmcField field({0.5f, 0.01f, 0.5f, 0.5f, 0.5f});
  // Invisible where exp(-d^2 / 2 s^2) < 0.05: beyond 2.45 deviations, 0.49.
  field.parameters["means_t"].values.write(field.queue, {0.5f, 0.5f, 1.5f, NAN, -0.48f});
  std::vector<float> log_scales;  // in space and time
  for (int i = 0; i < 5; ++i)
    for (const float s : {0.01f, 0.02f, 0.03f, 0.2f}) log_scales.push_back(std::log(s));
  field.parameters["log_scales"].values.write(field.queue, log_scales);
  field.refine();
  const std::vector<int> rows = field.sources();
  ASSERT_EQ(rows.size(), 5u);
  EXPECT_EQ(rows[0], 0);
  EXPECT_EQ(rows[4], 4);
  for (const size_t i : {1u, 2u, 3u}) EXPECT_TRUE(rows[i] == 0 || rows[i] == 4) << rows[i];
}

TEST(Mcmc, ThoseInOnePlaceShowWhatTheOneDid) {
  McmcField field({0.6f, 0.001f, 0.001f});
  field.refine();
  ASSERT_EQ(field.sources(), (std::vector<int>{0, 0, 0}));
  const double l = double(logit(0.6f));
  for (const float o : field.values("logit_opacities"))
    EXPECT_NEAR(std::pow(1 - sigmoid(double(o)), 3), 0.4, 1e-6);
  const std::vector<float> s = field.values("log_scales");
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k)  // rounding of 40 float terms
      EXPECT_NEAR(double(s[4 * i + k]), -1 + std::log(shared_scale(l, 3)), 2e-6);
    EXPECT_EQ(s[4 * i + 3], -1);  // the lifetime is unchanged
  }
}

// Scales 1, 2 and 1/2, rotated by 90 degrees about z, half a scale apart: deviations 1, 1/2 and
// 1/4.
TEST(Mcmc, ThoseInOnePlaceAreMovedApartByTheShapeOfTheOne) {
  const size_t n = 4000;
  std::vector<float> opacities(n, 0.001f), quats, log_scales;
  opacities[0] = 0.9f;
  for (size_t i = 0; i < n; ++i) {
    quats.insert(quats.end(), {1, 0, 0, 1});
    log_scales.insert(log_scales.end(), {0, std::log(2.f), std::log(0.5f), -1});
  }
  const auto moved = [&](float spread, uint32_t seed) {
    McmcField field(opacities);
    field.rule.spread = spread;
    field.parameters["quats"].values.write(field.queue, quats);
    field.parameters["log_scales"].values.write(field.queue, log_scales);
    field.parameters["means"].values.fill(field.queue, 3);
    field.refine(seed);
    return field.values("means");
  };
  const std::vector<float> means = moved(0.5f, 1);
  const double deviation[] = {1, 0.5, 0.25};
  for (size_t k = 0; k < 3; ++k) {
    double sum = 0, squares = 0;
    for (size_t i = 0; i < n; ++i) {
      const double x = (double(means[3 * i + k]) - 3) / deviation[k];
      sum += x;
      squares += x * x;
    }
    EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(double(n)));
    EXPECT_NEAR(std::sqrt(squares / n), 1, 5 / std::sqrt(2. * n));
  }
  EXPECT_EQ(moved(0.5f, 1), means);
  EXPECT_NE(moved(0.5f, 2), means);
  EXPECT_EQ(moved(0, 1), std::vector<float>(3 * n, 3));
}

TEST(Mcmc, NoneStartsOutDead) {
  std::vector<float> opacities(40, 0.001f);
  opacities[7] = 0.05f;
  McmcField field(opacities);
  field.refine();
  EXPECT_EQ(field.numbers(40)[7], 40);
  for (const float o : field.values("logit_opacities")) EXPECT_GE(o, logit(0.02f));
}

TEST(Mcmc, RowsThatShareStartWithoutMomentsTheOthersKeepTheirs) {
  McmcField field({0.9f, 0.001f, 0.03f});
  field.refine(3);
  const std::vector<int> rows = field.sources();
  ASSERT_EQ(rows, (std::vector<int>{0, 0, 2}));  // 30 to 1
  EXPECT_EQ(field.parameters.rows.steps.read(field.queue), (std::vector<cl_uint>{0, 0, 9}));
  EXPECT_EQ(field.parameters["mark"].exp_avg.read(field.queue), (std::vector<float>{0, 0, 2}));
  EXPECT_EQ(field.parameters["mark"].exp_avg_sq.read(field.queue), (std::vector<float>{0, 0, 2}));
}

TEST(Mcmc, AKeyedPathMovesWithItsGaussian) {
  McmcField field({0.001f, 0.5f, 0.001f}, MotionModelKind::keyframes);
  field.refine();
  ASSERT_EQ(field.sources(), (std::vector<int>{1, 1, 1}));
  for (const float shift : field.values("key_shifts")) EXPECT_EQ(shift, 1);
}

TEST(Mcmc, GrowsByAShareARoundUpToTheCap) {
  McmcField field(std::vector<float>(100, 0.5f));
  field.rule.growth = 0.05f;
  field.rule.cap = 112;
  for (const size_t expected : {105u, 111u, 112u, 112u}) {  // rounded up: small ones grow too
    field.refine();
    EXPECT_EQ(field.parameters.count, expected);
  }
  field.rule.cap = 50;
  field.refine();
  EXPECT_EQ(field.parameters.count, 112u);
}

// 20 000 systematic draws over 200 Gaussians: each count is the expected one up to the two
// intervals at its ends (2), and the mean over Gaussians of one opacity is almost exact.
TEST(Mcmc, DrawsInProportionToOpacity) {
  std::vector<float> opacities(20200, 0.001f);
  double sum = 0;
  for (size_t i = 0; i < 200; ++i) sum += double(opacities[101 * i] = 0.05f + 0.004f * float(i));
  McmcField field(opacities);
  field.refine();
  const std::vector<int> numbers = field.numbers(opacities.size());
  int all = 0;
  for (size_t i = 0; i < opacities.size(); ++i) {
    all += numbers[i];
    if (i % 101)
      EXPECT_EQ(numbers[i], 0);
    else
      EXPECT_NEAR(numbers[i], 1 + 20000 * double(opacities[i]) / sum, 2.1) << i;
  }
  EXPECT_EQ(all, 20200);  // no draw is lost
}

// One draw among 20 equal rows, 400 seeds: 20 each on average, deviation 4.4; allows five
// deviations.
TEST(Mcmc, FavoursNoRow) {
  std::vector<float> opacities(21, 0.5f), logits, marks;
  opacities[20] = 0.001f;
  McmcField field(opacities);
  for (size_t i = 0; i < 21; ++i) {
    logits.push_back(logit(opacities[i]));
    marks.push_back(float(i));
  }
  std::vector<int> hits(20);
  for (uint32_t seed = 0; seed < 400; ++seed) {
    field.parameters["logit_opacities"].values.write(field.queue, logits);
    field.parameters["mark"].values.write(field.queue, marks);
    field.refine(seed);
    ++hits[size_t(field.sources()[20])];
  }
  for (const int count : hits) EXPECT_NEAR(count, 20, 22);
}

TEST(Mcmc, WorksOnNoneOneAndAllDead) {
  McmcField none(std::vector<float>{});
  none.refine();
  EXPECT_EQ(none.parameters.count, 0u);
  McmcField one({0.5f});
  one.rule.growth = 1;
  one.refine();
  EXPECT_EQ(one.sources(), (std::vector<int>{0, 0}));
  McmcField dead({0.001f, 0.002f});
  dead.refine();
  EXPECT_EQ(dead.sources(), (std::vector<int>{0, 1}));
}

TEST(Mcmc, WithoutMemoryForMoreEverythingStaysAsItWas) {
  McmcField field(std::vector<float>(4, 0.5f));
  field.rule.growth = 1;
  field.queue.info.max_allocation = 4 * 4 * 6;  // log_scales of 6; 8 are requested
  try {
    field.refine();
    ADD_FAILURE() << "it fitted";
  } catch (const Error& problem) {
    EXPECT_TRUE(is_out_of_memory(problem)) << problem.what();
  }
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 2, 3}));
}

// ---- noise

struct Noised {
  std::vector<float> before, after;
};
// n Gaussians of one opacity with the factor diag(1, 2, 0.5). The first one is not seen; the last
// one does not exist at the rendered time.
Noised noised(size_t n, float opacity, float noise, uint32_t seed) {
  McmcField field(std::vector<float>(n, opacity));
  field.rule.noise = noise;
  GaussiansAt drawn;
  drawn.ensure(field.queue, n);
  std::vector<float> factors, there(n, 0.3f);
  for (size_t i = 0; i < n; ++i) factors.insert(factors.end(), {1, 0, 0, 0, 2, 0, 0, 0, 0.5f});
  there.back() = 0;
  drawn.factors.write(field.queue, factors);
  drawn.opacities.write(field.queue, there);
  field.parameters["means"].values.fill(field.queue, 0);
  std::vector<cl_uint> seen(n, 1);
  seen[0] = 0;
  field.parameters.rows.seen.write(field.queue, seen);
  Noised result;
  result.before = field.values("means");
  field.density.after_step(field.queue, field.parameters, drawn, field.rule,
                           {1, false, 0.25f, seed});
  result.after = field.values("means");
  return result;
}

// Covariance diag(1, 4, 0.25), noise x rate = 1, gate 1/2 at the minimum opacity: deviations 0.5, 2
// and 0.125. For 20 000 samples: mean within 5 / sqrt(20000), deviation within 5 / sqrt(40000).
TEST(Mcmc, NoiseHasTheShapeOfTheCovariance) {
  const size_t n = 20002;
  const Noised result = noised(n, 0.02f, 4, 7);
  const double deviation[] = {0.5, 2, 0.125};
  for (size_t k = 0; k < 3; ++k) {
    double sum = 0, squares = 0, cross = 0;
    for (size_t i = 1; i + 1 < n; ++i) {
      const double x = double(result.after[3 * i + k]) / deviation[k];
      sum += x;
      squares += x * x;
      cross += x * double(result.after[3 * i + (k + 1) % 3]) / deviation[(k + 1) % 3];
    }
    EXPECT_NEAR(sum / 20000, 0, 5 / std::sqrt(20000.));
    EXPECT_NEAR(std::sqrt(squares / 20000), 1, 5 / std::sqrt(40000.));
    EXPECT_NEAR(cross / 20000, 0, 5 / std::sqrt(20000.));  // axes are independent
  }
}

TEST(Mcmc, NoiseLeavesAloneWhatIsNotThereAndWhatIsOpaque) {
  const Noised faint = noised(3, 0.02f, 4, 7), opaque = noised(3, 0.5f, 4, 7);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(faint.after[k], 0);  // not seen
    EXPECT_NE(faint.after[3 + k], 0);
    EXPECT_EQ(faint.after[6 + k], 0);  // does not exist at that time
  }
  EXPECT_EQ(opaque.after, opaque.before);
}

TEST(Mcmc, NoiseIsAFunctionOfTheSeed) {
  EXPECT_EQ(noised(50, 0.02f, 4, 7).after, noised(50, 0.02f, 4, 7).after);
  EXPECT_NE(noised(50, 0.02f, 4, 7).after, noised(50, 0.02f, 4, 8).after);
}

// ---- regularisation of opacity and scale

TEST(Mcmc, GradientsAreThoseOfTheMeanOpacityAndSizeForRowsSeen) {
  McmcField field({0.3f, 0.6f, 0.9f});
  field.rule.opacity_weight = 0.5f;
  field.rule.scale_weight = 0.2f;
  Parameters& p = field.parameters;
  p["log_scales"].values.write(field.queue, {-1, 0, 1, 5, -2, 0.5f, -3, 5, 0, 0, 0, 0});
  p.rows.seen.write(field.queue, {1, 1, 0});
  p["logit_opacities"].grads.fill(field.queue, 1);
  p["log_scales"].grads.fill(field.queue, 1);
  const std::vector<float> logits = field.values("logit_opacities"), s = field.values("log_scales");
  field.density.add_gradients(field.queue, p, field.rule);
  const auto loss = [&](const std::vector<double>& x) {  // 3 logits, then 12 log scales
    double opacity = 0, size = 0;
    for (size_t i = 0; i < 3; ++i) {
      opacity += sigmoid(x[i]) / 3;
      for (size_t k = 0; k < 3; ++k) size += std::exp(x[3 + 4 * i + k]) / 9;
    }
    return 0.5 * opacity + 0.2 * size;
  };
  std::vector<double> x(logits.begin(), logits.end());
  x.insert(x.end(), s.begin(), s.end());
  std::vector<double> expected = numeric_gradient(loss, x);
  for (size_t i = 0; i < expected.size(); ++i)
    expected[i] = 1 + (i == 2 || i >= 11 ? 0 : expected[i]);  // the third one is not seen
  std::vector<float> got = p["logit_opacities"].grads.read(field.queue);
  for (const float v : p["log_scales"].grads.read(field.queue)) got.push_back(v);
  EXPECT_TRUE(all_close(got, expected, {1e-6, 1e-7}));
}

std::vector<uint32_t> mcmc_bits_after(uint32_t seed) {
  std::vector<float> opacities;
  for (int i = 0; i < 300; ++i) opacities.push_back(i % 3 ? 0.01f * float(3 + i % 40) : 0.001f);
  McmcField field(opacities);
  field.rule.growth = 0.2f;
  field.refine(seed);
  std::vector<uint32_t> bits;
  for (const ParameterGroup& group : field.parameters.groups)
    for (const float value : group.values.read(field.queue)) {
      uint32_t word;
      std::memcpy(&word, &value, 4);
      bits.push_back(word);
    }
  return bits;
}

TEST(Mcmc, GivesTheSameBitsForASeedAndOthersForAnother) {
  EXPECT_EQ(mcmc_bits_after(5), mcmc_bits_after(5));
  EXPECT_NE(mcmc_bits_after(5), mcmc_bits_after(6));
}

}  // namespace
}  // namespace gflow
