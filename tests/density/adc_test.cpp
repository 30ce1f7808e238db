// SPDX-License-Identifier: Apache-2.0
#include "optim/density/adc.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "optim/motion/native4d.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/density_rule.hpp"
#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

// A Gaussian's state for density control. The video lasts from 0 to 1.
struct Made {
  float opacity = 0.5f, scale = 0.1f, lifetime = 0.2f, mean_t = 0.5f;
  float tilt = 0;      // of its time axis towards x [rad]; its speed is the tangent of this
  float grad2d = 0;    // mean gradient of the image position over views [half the image]
  uint32_t tiles = 1;  // 0: not seen
};

// Rows are marked: means, colours and temporal means of row i contain i.
class AdcField {
 public:
  explicit AdcField(const std::vector<Made>& made)
      : queue(test_queue()),
        motion(queue, 0.05f),
        density(queue),
        parameters(queue, made.size(), all_groups()),
        made_(made) {
    rule.grad_threshold = 1;
    rule.prune_scale = 10;
    rule.split.split_scale = 0.5f;
    const size_t n = made.size();
    std::vector<float> log_scales, logits, means_t, quats, quats_r;
    for (const Made& m : made) {
      log_scales.insert(log_scales.end(), 3, std::log(m.scale));
      log_scales.push_back(std::log(m.lifetime));
      logits.push_back(logit(m.opacity));
      means_t.push_back(m.mean_t);
      const float c = std::cos(m.tilt / 2), d = std::sin(m.tilt / 2);
      quats.insert(quats.end(), {c, d, 0, 0});
      quats_r.insert(quats_r.end(), {c, -d, 0, 0});
    }
    for (ParameterGroup& group : parameters.groups) {
      std::vector<float> own;
      for (size_t i = 0; i < n * group.width; ++i) own.push_back(float(i / group.width));
      group.values.write(queue, own);
      group.remember(queue);
      group.exp_avg.write(queue, own);
      group.exp_avg_sq.write(queue, own);
    }
    parameters["log_scales"].values.write(queue, log_scales);
    parameters["logit_opacities"].values.write(queue, logits);
    parameters["means_t"].values.write(queue, means_t);
    parameters["quats"].values.write(queue, quats);
    parameters["quats_r"].values.write(queue, quats_r);
    std::vector<uint32_t> steps(n);
    for (size_t i = 0; i < n; ++i) steps[i] = uint32_t(1000 + i);
    parameters.rows.steps.write(queue, steps);
  }

  // A view of 20 x 10 pixels with a gradient of grad2d / 10 per pixel along x.
  void see(float factor = 1, const RowList& rows = {}, bool some_ignored = false) {
    std::vector<uint32_t> tiles;
    std::vector<float> v_means2d;
    for (const Made& m : made_) {
      tiles.push_back(m.tiles);
      v_means2d.insert(v_means2d.end(), {factor * m.grad2d / 10, 0});
    }
    const Buffer<cl_uint> touched(queue, tiles, "tiles");
    const Buffer<float> v(queue, v_means2d, "v_means2d");
    density.see(queue, parameters, {20, 10, rows, touched, v, some_ignored});
  }
  void refine(uint32_t seed = 1) { density.refine(queue, parameters, motion, rule, seed); }

  std::vector<float> values(const std::string& name) { return parameters[name].values.read(queue); }
  // The old row of each new row, and how often it occurs.
  std::vector<int> sources() {
    std::vector<int> rows;
    const std::vector<float> marks = values("mark");
    for (const float m : marks) rows.push_back(int(m));
    return rows;
  }

  Queue queue;
  Native4dMotion motion;
  AdcDensity density;
  DensityRule rule = quiet_rule();
  Parameters parameters;

 private:
  std::vector<GroupSpec> all_groups() const {
    std::vector<GroupSpec> groups = motion.groups();
    groups.push_back({"mark", 1});  // an array unknown to splitting
    return groups;
  }
  std::vector<Made> made_;
};

Made with_grad2d(float grad2d, float scale = 0.1f) {
  Made m;
  m.grad2d = grad2d;
  m.scale = scale;
  return m;
}

TEST(Adc, KeepsWhatIsSeenAndLeftInPeace) {
  AdcField field({with_grad2d(0), with_grad2d(0.9f), with_grad2d(0.5f)});
  const auto before = field.values("means");
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(field.values("means"), before);
}

// In two views a Gaussian has the gradients 1.5 and 0. Where pixels are ignored, the mean is 1.5.
TEST(Adc, AViewOfIgnoredPixelsOnlyIsNoView) {
  for (const bool some_ignored : {false, true}) {
    AdcField field({with_grad2d(1.5f)});
    field.see(1, {}, some_ignored);
    field.see(0, {}, some_ignored);
    field.refine();
    EXPECT_EQ(field.sources().size(), some_ignored ? 2u : 1u);
  }
}

TEST(Adc, RemovesTheFaintTheHugeAndTheNeverVisible) {
  Made faint, huge, early, late, nearly;
  faint.opacity = 0.004f;
  huge.scale = 11;
  // A Gaussian is invisible where exp(-d^2 / 2 s^2) < 0.05: beyond 2.45 standard deviations.
  early.mean_t = -0.5f;  // 2.5 standard deviations of 0.2 before the video
  late.mean_t = 1.5f;
  nearly.mean_t = -0.48f;  // 2.4 standard deviations
  AdcField field({faint, Made{}, huge, early, late, nearly, Made{}});
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{1, 5, 6}));
}

TEST(Adc, RemovesWhatIsHugeAlongAnyAxis) {
  AdcField field(std::vector<Made>(4));
  std::vector<float> log_scales = field.values("log_scales");
  for (size_t i = 0; i < 3; ++i) log_scales[4 * i + i] = std::log(11.f);
  field.parameters["log_scales"].values.write(field.queue, log_scales);
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{3}));
}

// In a view of 20 x 10 pixels half the image is 10 pixels wide and 5 high.
TEST(Adc, GradientsCountByHalfTheImageAlongEachAxis) {
  AdcField field(std::vector<Made>(4));
  const Buffer<cl_uint> touched(field.queue, {1, 1, 1, 1}, "tiles");
  const Buffer<float> v(field.queue, {0.09f, 0, 0.11f, 0, 0, 0.18f, 0, 0.22f}, "v_means2d");
  field.density.see(field.queue, field.parameters, {20, 10, {}, touched, v});
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 1, 2, 3, 3}));
}

TEST(Adc, MakesTwoOfWhatHasAGradientAboveTheThreshold) {
  AdcField field({with_grad2d(0.99f), with_grad2d(1.01f), with_grad2d(2, 1.f), with_grad2d(0)});
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 1, 2, 2, 3}));
}

TEST(Adc, ComparesTheMeanOverTheViewsThatSawIt) {
  Made hidden = with_grad2d(50);
  hidden.tiles = 0;
  AdcField field({with_grad2d(1.2f), with_grad2d(1.8f), hidden});
  field.see(1);
  field.see(0.5f);  // means: 0.9, 1.35
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 1, 2}));
}

TEST(Adc, ForgetsTheEvidenceOnceUsed) {
  AdcField field({with_grad2d(2)});
  field.see();
  field.refine();
  EXPECT_EQ(field.parameters.count, 2u);
  field.refine();
  EXPECT_EQ(field.parameters.count, 2u);
}

TEST(Adc, GivesTheRoomBelowTheCapToTheLargestGradients) {
  std::vector<Made> made;
  for (const float grad2d : {2.f, 9.f, 3.f, 7.f, 0.f, 5.f}) made.push_back(with_grad2d(grad2d));
  AdcField field(made);
  field.rule.cap = 8;  // space for two
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 1, 2, 3, 3, 4, 5}));
}

TEST(Adc, GrowsNothingAtOrAboveTheCap) {
  for (const size_t cap : {size_t(1), size_t(2)}) {
    AdcField field({with_grad2d(2), with_grad2d(3)});
    field.rule.cap = cap;
    field.see();
    field.refine();
    EXPECT_EQ(field.sources(), (std::vector<int>{0, 1}));
  }
}

TEST(Adc, AmongEqualGradientsTheFirstGrow) {
  AdcField field(std::vector<Made>(6, with_grad2d(2)));
  field.rule.cap = 8;
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 0, 1, 1, 2, 3, 4, 5}));
}

TEST(Adc, SurvivorsKeepTheirMomentsAndStepsChildrenStartWithNone) {
  Made faint;
  faint.opacity = 0.001f;
  AdcField field({faint, with_grad2d(0), with_grad2d(2), with_grad2d(0)});
  field.see();
  field.refine();
  ASSERT_EQ(field.sources(), (std::vector<int>{1, 2, 2, 3}));
  EXPECT_EQ(field.parameters.rows.steps.read(field.queue),
            (std::vector<uint32_t>{1001, 0, 0, 1003}));
  for (const ParameterGroup& group : field.parameters.groups)
    for (const Buffer<float>* moment : {&group.exp_avg, &group.exp_avg_sq}) {
      const std::vector<float> m = moment->read(field.queue);
      ASSERT_EQ(m.size(), 4 * group.width);
      const float expected[4] = {1, 0, 0, 3};
      for (size_t i = 0; i < m.size(); ++i) EXPECT_EQ(m[i], expected[i / group.width]);
    }
}

TEST(Adc, ChildrenOfALargeOneAreSmallerAndLiveAsLong) {
  Made made = with_grad2d(2, 1.f);
  made.lifetime = 50;
  AdcField field({made});
  field.see();
  field.refine();
  ASSERT_EQ(field.parameters.count, 2u);
  std::vector<double> expected;  // divided by 1.6, as usual
  for (int child = 0; child < 2; ++child)
    expected.insert(expected.end(),
                    {-std::log(1.6), -std::log(1.6), -std::log(1.6), std::log(50.)});
  EXPECT_TRUE(all_close(field.values("log_scales"), expected, {1e-6, 1e-7}));  // a few roundings
}

// Speed 1 with a lifetime of 0.2: it travels 0.4 while visible, 40 times its size.
Made traveller() {
  Made made = with_grad2d(2, 0.01f);
  made.tilt = std::atan(1.f);
  made.lifetime = 0.2f * std::sqrt(2.f);  // the tilted axis: |p_t| = 0.2
  return made;
}

TEST(Adc, OneThatTravelsFarIsSplitInTimeAlongItsPath) {
  AdcField field({with_grad2d(0), traveller()});
  const std::vector<float> opacities = field.values("logit_opacities");
  field.see();
  field.refine();
  ASSERT_EQ(field.sources(), (std::vector<int>{0, 1, 1}));
  const std::vector<float> t = field.values("means_t"), x = field.values("means"),
                           s = field.values("log_scales"), o = field.values("logit_opacities");
  // |p_t|^2 = (0.2^2 x 2 + 0.01^2) / 2 and the velocity (0.08 - 0.0001) / (0.08 + 0.0001): the
  // values below are accurate to 0.3 %.
  EXPECT_NEAR(t[1], 0.5 - 0.1, 1e-3);
  EXPECT_NEAR(t[2], 0.5 + 0.1, 1e-3);
  for (size_t child = 1; child < 3; ++child) {
    EXPECT_NEAR(x[3 * child] - 1, t[child] - 0.5, 1e-3);  // row 1 started at (1, 1, 1)
    EXPECT_NEAR(x[3 * child + 1], 1, 1e-6);
    EXPECT_NEAR(s[4 * child + 3], std::log(0.6 * 0.2 * std::sqrt(2.)), 3e-3);
    EXPECT_EQ(o[child], opacities[1]);  // the children follow each other in time
  }
}

TEST(Adc, LivesAreNotCutShorterThanAllowed) {
  AdcField field({traveller()});
  field.rule.split.min_lifetime = 0.13f;  // above 0.6 x 0.2
  field.see();
  field.refine();
  ASSERT_EQ(field.parameters.count, 2u);
  for (const float t : field.values("means_t")) EXPECT_EQ(t, 0.5f);
}

TEST(Adc, ChildrenOfASmallOneKeepItsSizeAndOneOfThemItsPlace) {
  AdcField field({with_grad2d(0), with_grad2d(2)});
  const std::vector<float> scales = field.values("log_scales");
  field.see();
  field.refine();
  ASSERT_EQ(field.sources(), (std::vector<int>{0, 1, 1}));
  const std::vector<float> after = field.values("log_scales"), means = field.values("means");
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(after[i], scales[i % 4]);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(means[3 + k], 1);
    EXPECT_NE(means[6 + k], 1);
    EXPECT_NEAR(means[6 + k], 1, 0.6);  // sampled from the parent, within six deviations of 0.1
  }
}

// Sampled from the parent: over 2 x 400 children the mean is within 5 / sqrt(800) deviations of the
// parent's, and the deviation within a fraction of 5 / sqrt(1600).
TEST(Adc, ChildrenOfLargeOnesSpreadAsTheParentDoes) {
  AdcField field(std::vector<Made>(400, with_grad2d(2, 0.8f)));
  field.see();
  field.refine();
  const std::vector<float> means = field.values("means"), marks = field.values("mark");
  ASSERT_EQ(marks.size(), 800u);
  double sum = 0, squares = 0;
  for (size_t i = 0; i < 800; ++i) {
    const double d = (double(means[3 * i]) - double(marks[i])) / 0.8;
    sum += d;
    squares += d * d;
  }
  EXPECT_NEAR(sum / 800, 0, 5 / std::sqrt(800.));
  EXPECT_NEAR(std::sqrt(squares / 800), 1, 5 / std::sqrt(1600.));
}

// 1 - o = (1 - o')^2: two children in one place look like the parent. o' is rounded to a float
// logit.
TEST(Adc, TwoChildrenTogetherAreAsOpaqueAsTheParent) {
  for (const float opacity : {0.01f, 0.3f, 0.9f, 0.99f}) {
    Made made = with_grad2d(2);
    made.opacity = opacity;
    AdcField field({made});
    field.see();
    field.refine();
    for (const float child : field.values("logit_opacities"))
      EXPECT_NEAR(std::pow(1 - sigmoid(double(child)), 2), 1 - double(opacity), 2e-6) << opacity;
  }
}

TEST(Adc, IgnoresGradientsThatAreNotFinite) {
  AdcField field({with_grad2d(std::nanf("")), with_grad2d(HUGE_VALF), with_grad2d(2)});
  field.see();
  field.refine();
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 2, 2}));
}

TEST(Adc, WorksOnNoneAndOne) {
  AdcField none(std::vector<Made>{});
  none.see();
  none.refine();
  EXPECT_EQ(none.parameters.count, 0u);
  AdcField one({with_grad2d(0)});
  one.see();
  one.refine();
  EXPECT_EQ(one.parameters.count, 1u);
}

TEST(Adc, MayRemoveEverything) {
  Made faint;
  faint.opacity = 0.001f;
  AdcField field({faint, faint});
  field.see();
  field.refine();
  EXPECT_EQ(field.parameters.count, 0u);
  field.refine();
  EXPECT_EQ(field.parameters.count, 0u);
}

TEST(Adc, ResetsOpacitiesAndTheirMeanGradientOnlyWhenDueAndWhereHigher) {
  Made low;
  low.opacity = 0.008f;
  AdcField field({low, Made{}});
  field.rule.opacity_reset_every = 300;
  const std::vector<float> before = field.values("logit_opacities");
  const GaussiansAt drawn;
  const auto after = [&](int done, bool refining) {
    field.density.after_step(field.queue, field.parameters, drawn, field.rule,
                             {done, refining, 0, 0});
    return field.values("logit_opacities");
  };
  EXPECT_EQ(after(299, true), before);
  EXPECT_EQ(after(600, false), before);
  const std::vector<float> reset = after(600, true);
  EXPECT_EQ(reset[0], before[0]);
  EXPECT_NEAR(sigmoid(double(reset[1])), 2 * 0.005, 1e-8);  // rounding of a logit near -5
  const ParameterGroup& opacities = field.parameters["logit_opacities"];
  EXPECT_EQ(opacities.exp_avg.read(field.queue), (std::vector<float>{0, 0}));  // row 0 was 0 before
  EXPECT_EQ(opacities.exp_avg_sq.read(field.queue), (std::vector<float>{0, 1}));  // unchanged
  EXPECT_EQ(field.parameters["means"].exp_avg.read(field.queue)[3], 1);
}

TEST(Adc, EvidenceSurvivesBeingSavedAndLoaded) {
  AdcField saved({with_grad2d(2), with_grad2d(0.5f)}), loaded({with_grad2d(2), with_grad2d(0.5f)});
  saved.see();
  Arrays arrays;
  saved.density.save_state(saved.queue, arrays);
  loaded.density.load_state(loaded.queue, arrays, "a file");
  loaded.refine();
  EXPECT_EQ(loaded.sources(), (std::vector<int>{0, 0, 1}));
}

TEST(Adc, WithoutMemoryForMoreEverythingStaysAsItWas) {
  AdcField field({with_grad2d(2), with_grad2d(3), with_grad2d(0)});
  field.see();
  field.queue.info.max_allocation = 4 * 4 * 4;  // log_scales of 4 Gaussians; 5 are requested
  try {
    field.refine();
    ADD_FAILURE() << "it fitted";
  } catch (const Error& problem) {
    EXPECT_TRUE(is_out_of_memory(problem)) << problem.what();
  }
  EXPECT_EQ(field.parameters.count, 3u);
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 1, 2}));
  field.queue.info.max_allocation = 1 << 20;
  field.refine();  // the accumulated gradients are kept
  EXPECT_EQ(field.sources(), (std::vector<int>{0, 0, 1, 1, 2}));
}

std::vector<uint32_t> adc_bits_after(uint32_t seed) {
  std::vector<Made> made;
  for (int i = 0; i < 300; ++i)
    made.push_back(with_grad2d(float(i % 7) / 3, 0.1f * float(1 + i % 11)));
  AdcField field(made);
  field.rule.cap = 400;
  field.see();
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

TEST(Adc, GivesTheSameBitsForASeedAndOthersForAnother) {
  EXPECT_EQ(adc_bits_after(5), adc_bits_after(5));
  EXPECT_NE(adc_bits_after(5), adc_bits_after(6));
}

}  // namespace
}  // namespace gflow
