// SPDX-License-Identifier: Apache-2.0
// Guidance in training: its effect on the model, whether it helps, and that a failing provider
// costs only its step.
#include "optim/objectives/guidance_objective.hpp"

#include "optim/eval/evaluation.hpp"
#include "optim/guidance/sds_guidance.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// A scene with images and flow of its held-out camera as known views.
struct Made {
  Made() {
    fs::copy(scene.path() + "/cam00/images", views.path() + "/cam00");
    fs::create_directories(views.path() + "/flow");
    fs::copy(scene.path() + "/flow/cam00", views.path() + "/flow/cam00");
  }
  Queue queue = test_queue();
  SmallScene scene{queue};
  TemporaryFolder views;
};

class GuideTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { made_ = new Made; }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }
  Queue& queue() { return made_->queue; }
  const std::string& views() { return made_->views.path(); }

  TrainOptions config(int iterations) {
    TrainOptions config = small_config(made_->scene, iterations);
    config.guidance.provider = GuidanceProvider::analytic;
    config.guidance.images = views();
    config.guidance.cameras = GuidanceCameras::test;
    return config;
  }
  std::unique_ptr<Guidance> analytic(const TrainOptions& config) {
    return std::make_unique<AnalyticGuidance>(views(), double(config.guidance.variance),
                                              NoiseSchedule::scaled_linear(), SdsRule{});
  }
  // Metrics of the held-out camera after training.
  ViewMetrics trained(const TrainOptions& config, Guidance* guidance) {
    SmallTraining training(queue(), config, guidance);
    training.steps(queue(), config.train.iterations);
    return evaluate(queue(), training.model, training.config, training.loaded,
                    training.loaded.scene.test, {}, "", "")
        .mean;
  }

 private:
  static Made* made_;
};
Made* GuideTest::made_ = nullptr;

// Answers by a function and records the requests.
class Asked : public Guidance {
 public:
  using Answering = std::function<GuidanceAnswer(const GuidanceRequest&, const GuidanceView&)>;
  explicit Asked(Answering answering = {}) : answering_(std::move(answering)) {}
  std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) override {
    requests.push_back(request);
    std::vector<GuidanceAnswer> answers;
    for (const GuidanceView& view : request.views)
      answers.push_back(answering_ ? answering_(request, view) : GuidanceAnswer{});
    return answers;
  }
  std::string name() const override { return "the test"; }
  std::vector<GuidanceRequest> requests;

 private:
  Answering answering_;
};

TEST_F(GuideTest, AGuidanceWithoutAnswersChangesNoBit) {
  TrainOptions with = config(60), without = with;
  without.guidance = {};
  Asked silent;
  SmallTraining a(queue(), with, &silent), b(queue(), without);
  a.steps(queue(), 60);
  b.steps(queue(), 60);
  EXPECT_EQ(silent.requests.size(), 60u);
  EXPECT_TRUE(a.bits(queue()) == b.bits(queue()));
}

TEST_F(GuideTest, AsksInTheStepsAndAboutTheViewsThatAreSet) {
  TrainOptions set = config(20);
  set.guidance.cameras = GuidanceCameras::orbit;
  set.guidance.start = 3;
  set.guidance.every = 4;
  set.guidance.stop = 12;
  set.guidance.views = 3;
  set.guidance.azimuth = 50;
  set.guidance.elevation = 20;
  set.guidance.size = 32;
  set.guidance.flow = 1;
  Asked asked;
  SmallTraining training(queue(), set, &asked);
  training.steps(queue(), 20);
  ASSERT_EQ(asked.requests.size(), 3u);  // 3, 7, 11
  double least = 50, most = -50;
  for (size_t r = 0; r < 3; ++r) {
    const GuidanceRequest& request = asked.requests[r];
    EXPECT_EQ(request.step, 3 + 4 * int(r));
    EXPECT_DOUBLE_EQ(request.progress, double(r) / 2);
    EXPECT_EQ(request.time, request.frame / 4.0);
    EXPECT_EQ(request.wants_flow, request.frame < 4);
    EXPECT_DOUBLE_EQ(request.next_time, request.wants_flow ? request.time + 0.25 : 0);
    EXPECT_EQ(request.reference.rgb.size(), 3u * 48 * 40);
    ASSERT_EQ(request.views.size(), 3u);
    for (const GuidanceView& view : request.views) {
      EXPECT_EQ(view.camera.name, "");
      EXPECT_EQ(view.rgb.size(), 3u * 32 * 32);
      EXPECT_EQ(view.flow.size(), request.wants_flow ? 2u * 32 * 32 : 0u);
      EXPECT_LE(std::fabs(view.elevation), 20);
      EXPECT_NEAR(view.distance, 0, 1e-9);
      least = std::min(least, view.azimuth);
      most = std::max(most, view.azimuth);
    }
  }
  EXPECT_GE(least, -50);
  EXPECT_LE(most, 50);
  EXPECT_GT(most - least, 30);
}

// The gradient of three views, two of them rendered again, against those of each alone.
TEST_F(GuideTest, TheGradientIsThatOfTheMeanOverViews) {
  const auto gradient = [](const GuidanceRequest&, const GuidanceView& view) {
    GuidanceAnswer answer;
    answer.weight = float(1 + std::fabs(view.azimuth));
    answer.gradient = view.rgb;
    return answer;
  };
  TrainOptions set = config(10);
  set.guidance.cameras = GuidanceCameras::orbit;
  set.guidance.weight = 6;
  set.guidance.views = 3;
  Asked asked(gradient);
  SmallTraining training(queue(), set);
  Renderer renderer(queue(), engine_settings(set));
  GuidanceObjective objective(queue(), set, training.loaded.scene, *training.loaded.frames, asked);
  StepContext context;
  context.background = {255, 255, 255};
  context.frame = &training.loaded.scene.train[2];
  Parameters& p = training.model.parameters;
  const auto read = [&] { return p["means"].grads.read(queue()); };
  p.count_as_seen(queue());
  NovelViews views{queue(), training.model, renderer, [](const Shot&) {}};
  objective.add_novel_views(views, context);
  const std::vector<float> together = read();

  const GuidanceRequest request = asked.requests.at(0);
  std::vector<double> apart(together.size());
  for (const GuidanceView& view : request.views) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(view.camera, set.render.near);
    shot.time = request.time;
    shot.sh_degree = 0;
    renderer.forward(queue(), training.model, shot);
    const std::vector<float> rgb = renderer.images().rgb.read(queue());
    EXPECT_EQ(rgb, view.rgb);
    ImageGradients v;
    std::vector<float> v_rgb = rgb;
    for (float& value : v_rgb)
      value *= 6 * float(1 + std::fabs(view.azimuth)) / (3 * float(rgb.size()));
    v.v_rgb = Buffer<float>(queue(), v_rgb, "v_rgb");
    v.v_alpha = Buffer<float>(queue(), std::vector<float>(rgb.size() / 3), "v_alpha");
    p.count_as_seen(queue());
    renderer.backward(queue(), training.model, v);
    const std::vector<float> alone = read();
    for (size_t i = 0; i < apart.size(); ++i) apart[i] += double(alone[i]);
  }
  double largest = 0;
  for (const double value : apart) largest = std::max(largest, std::fabs(value));
  ASSERT_GT(largest, 0);
  for (size_t i = 0; i < apart.size(); ++i) EXPECT_NEAR(together[i], apart[i], 1e-5 * largest) << i;
}

// Guidance alone: the model learns its colours from the known images only.
TEST_F(GuideTest, AnalyticGuidanceAloneTrainsTowardsTheKnownImages) {
  constexpr int steps = 150;
  TrainOptions set = config(steps);
  const auto guidance = analytic(set);
  SmallTraining training(queue(), set);
  Renderer renderer(queue(), engine_settings(set));
  GuidanceObjective objective(queue(), set, training.loaded.scene, *training.loaded.frames,
                              *guidance);
  Adam adam(queue());
  Parameters& p = training.model.parameters;
  const auto evaluated = [&] {
    return evaluate(queue(), training.model, set, training.loaded, training.loaded.scene.test, {},
                    "", "")
        .mean.psnr;
  };
  const double before = evaluated();
  const std::vector<Frame>& frames = training.loaded.scene.train;
  for (int step = 0; step < steps; ++step) {
    StepContext context;
    context.step = step;
    context.background = {255, 255, 255};
    context.frame = &frames[size_t(step) % frames.size()];
    p.forget_seen(queue());
    NovelViews views{queue(), training.model, renderer, [](const Shot&) {}};
    objective.add_novel_views(views, context);
    adam.advance(queue(), p.rows, p.active);
    for (size_t g = 0; g < p.groups.size(); ++g) {
      const bool color = p.specs[g].quantity == Quantity::color;
      if (color || p.specs[g].quantity == Quantity::opacity)
        adam.step(queue(), p.groups[g], p.rows, p.active_in(p.specs[g]),
                  {color ? 0.03f : 0.05f, 1e-8f});
    }
  }
  EXPECT_LT(before, 12);
  EXPECT_GT(evaluated(), before + 6) << before;
}

TEST_F(GuideTest, FlowOfANovelViewTeachesItsMotion) {
  TrainOptions without = config(300);
  without.flow.enabled = false;
  without.density.enabled = false;
  without.guidance.weight = 0;
  without.guidance.flow = 0;
  TrainOptions with = without;
  with.guidance.flow = 0.05f;
  const auto none = analytic(without), some = analytic(with);
  const ViewMetrics before = trained(without, none.get()), after = trained(with, some.get());
  EXPECT_LT(after.flow_epe, 0.65 * before.flow_epe) << before.flow_epe;
}

TEST_F(GuideTest, GoesOnFromASavedStateWithTheSameBits) {
  TrainOptions set = config(160);
  set.guidance.flow = 0.05f;
  set.guidance.views = 2;
  set.guidance.every = 3;
  const auto guidance = analytic(set);
  SmallTraining whole(queue(), set, guidance.get()), resumed(queue(), set, guidance.get());
  whole.steps(queue(), 80);
  resumed.go_on(queue(), whole.trainer.state(queue()), 80);
  whole.steps(queue(), 80);
  resumed.steps(queue(), 80);
  EXPECT_TRUE(whole.bits(queue()) == resumed.bits(queue()));
}

TEST_F(GuideTest, AFailureLeavesTheTrainingAsItWas) {
  TrainOptions set = config(200);
  const auto guidance = analytic(set);
  int answers_left = 130;
  Asked failing([&](const GuidanceRequest& request, const GuidanceView&) {
    if (answers_left-- == 0) throw GuidanceFailed("the test gives up");
    return guidance->guide(request)[0];
  });
  SmallTraining uninterrupted(queue(), set, guidance.get()), failed(queue(), set, &failing);
  uninterrupted.steps(queue(), 200);
  EXPECT_THROW(failed.steps(queue(), 200), GuidanceFailed);
  SmallTraining resumed(queue(), set, guidance.get());
  resumed.go_on(queue(), failed.trainer.state(queue()), 130);
  resumed.steps(queue(), 70);
  EXPECT_TRUE(uninterrupted.bits(queue()) == resumed.bits(queue()));
}

TEST_F(GuideTest, AnswersThatDoNotFitAreNamed) {
  const auto refused = [&](const GuidanceAnswer& answer, std::initializer_list<std::string> parts) {
    Asked asked([&](const GuidanceRequest&, const GuidanceView&) { return answer; });
    SmallTraining training(queue(), config(1), &asked);
    expect_error([&] { training.steps(queue(), 1); }, parts);
  };
  GuidanceAnswer small, infinite, weight;
  small.gradient.assign(5, 0.f);
  infinite.gradient.assign(3 * 48 * 40, std::nanf(""));
  weight.weight = -1;
  refused(small, {"the test", "step 0", "gradient of 5 values", "3 x 40 x 48 = 5760"});
  refused(infinite, {"NaN or Inf"});
  refused(weight, {"weights -1", "at least 0"});
}

TEST_F(GuideTest, ASplitWithoutViewsIsNamed) {
  TrainOptions set = config(1);
  set.guidance.cameras = GuidanceCameras::val;
  Asked asked;
  expect_error([&] { SmallTraining(queue(), set, &asked); }, {"no val views"});
}

}  // namespace
}  // namespace gflow
