// SPDX-License-Identifier: Apache-2.0
// The trainer's extension points as external code uses them: a custom objective, an observer, and
// train() on a scene in memory. None of them needs a change of gflow.
#include <gtest/gtest.h>

#include "optim/runs/train_run.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

// Pulls every image towards black: weight x mean of rgb.
class Darkness : public Objective {
 public:
  explicit Darkness(float weight) : weight_(weight) {}

  void add_gradients(Queue& queue, const ViewContext&, const Renderer& renderer,
                     ImageGradients& v) override {
    const std::vector<float> rgb = renderer.images().rgb.read(queue);
    mean_ = 0;
    for (const float value : rgb) mean_ += double(value) / double(rgb.size());
    std::vector<float> v_rgb = v.v_rgb.read(queue);
    for (float& value : v_rgb) value += weight_ / float(v_rgb.size());
    v.v_rgb.write(queue, v_rgb);
  }
  void report(Queue&, const Renderer&, LossReport& report) override {
    report.loss += double(weight_) * mean_;
    report.terms.push_back({"darkness", mean_, fmt::format("darkness {:.3f}", mean_)});
  }

 private:
  float weight_;
  double mean_ = 0;
};

// Requests flow and depth of every view, and pulls the depth towards 0.
class Nearness : public Objective {
 public:
  void request(Queue&, const ViewContext&, Shot& shot) override { shot.flow = shot.depth = true; }
  void add_gradients(Queue& queue, const ViewContext&, const Renderer& renderer,
                     ImageGradients& v) override {
    const std::vector<float> depth = renderer.images().depth.read(queue);
    mean_ = 0;
    for (const float value : depth) mean_ += double(value) / double(depth.size());
    for (const float value : v.v_flow.read(queue)) nonzero_ += value != 0;
    std::vector<float> v_depth = v.v_depth.read(queue);
    for (float& value : v_depth) {
      nonzero_ += value != 0;
      value += 1.f / float(depth.size());
    }
    v.v_depth.write(queue, v_depth);
  }
  void report(Queue&, const Renderer&, LossReport& report) override {
    report.loss += mean_;
    report.terms.push_back({"nearness", mean_, ""});
    report.terms.push_back({"nonzero", double(nonzero_), ""});
  }

 private:
  double mean_ = 0;
  size_t nonzero_ = 0;  // gradients that did not start at 0
};

// Pulls every Gaussian in view towards standing still: weight x sum of |mean(t2) - mean(t1)|^2,
// and of |mean(t1) - mean(t0)|^2 where there is a t0.
class Stillness : public Objective {
 public:
  explicit Stillness(float weight) : weight_(weight) {}

  void request(Queue&, const ViewContext&, Shot& shot) override {
    shot.pose_t2 = shot.pose_t0 = true;
  }
  void add_pose_gradients(Queue& queue, const ViewContext&, const Renderer& renderer,
                          GaussianGradients& v) override {
    sum_ = 0;
    add(queue, renderer, renderer.gaussians(), renderer.gaussians_t2(), v.v_means, v.v_means_t2);
    if (const GaussiansAt* t0 = renderer.gaussians_t0()) {
      ++views_with_t0;
      add(queue, renderer, *t0, renderer.gaussians(), v.v_means_t0, v.v_means);
    }
  }
  void report(Queue&, const Renderer&, LossReport& report) override {
    report.loss += sum_;
    report.terms.push_back({"stillness", sum_, ""});
    report.terms.push_back({"views_with_t0", double(views_with_t0), ""});
  }

 private:
  void add(Queue& queue, const Renderer& renderer, const GaussiansAt& from, const GaussiansAt& to,
           Buffer<float>& v_from, Buffer<float>& v_to) {
    const std::vector<cl_uint> drawn = renderer.engine().splats().tiles_touched.read(queue);
    const std::vector<float> a = from.means.read(queue), b = to.means.read(queue);
    std::vector<float> v_a = v_from.read(queue), v_b = v_to.read(queue);
    for (size_t i = 0; i < 3 * drawn.size(); ++i) {
      if (drawn[i / 3] == 0) continue;
      const float step = b[i] - a[i];
      sum_ += double(weight_) * double(step) * double(step);
      v_a[i] -= 2 * weight_ * step;
      v_b[i] += 2 * weight_ * step;
    }
    v_from.write(queue, v_a);
    v_to.write(queue, v_b);
  }

  float weight_;
  double sum_ = 0;
  int views_with_t0 = 0;
};

MakeObjective darkness(float weight) {
  return [weight](const TrainInputs&) { return std::make_unique<Darkness>(weight); };
}

// Counts the training steps and stops after `most`.
class Counter : public TrainObserver {
 public:
  explicit Counter(int most = 1000000) : most_(most) {}
  void after_step(TrainState& state) override {
    seen.push_back(state.done);
    last_loss = state.report().loss;
    gaussians = state.model().parameters.count;
  }
  void on_flow(size_t done, size_t pairs) override { flow.emplace_back(done, pairs); }
  void on_notice(const std::string& sentence) override { notices.push_back(sentence); }
  bool stop(int done) override { return done >= most_; }

  std::vector<std::pair<size_t, size_t>> flow;
  std::vector<std::string> notices;
  std::vector<int> seen;
  double last_loss = 0;
  size_t gaussians = 0;

 private:
  int most_;
};

// A scene with images in memory and without files.
Scene scene_in_memory(const TrainOptions& config) {
  LoadedScene loaded = load_scene(config.scene, "");
  Scene scene;
  scene.name = "in memory";
  scene.cameras = loaded.scene.cameras;
  scene.points = loaded.scene.points;
  for (const Frame& file : loaded.scene.train) {
    Frame frame;
    frame.camera = file.camera;
    frame.track = file.track;
    frame.time = file.time;
    frame.name = file.name;
    frame.image = loaded.frames->rgb(file);
    scene.train.push_back(frame);
  }
  complete_scene(scene);
  return scene;
}

class Seams : public OnOneScene {
 protected:
  TrainOptions config(int iterations) {
    TrainOptions config = small_config(scene(), iterations);
    config.flow.enabled = false;
    config.train.log_every = 10;
    return config;
  }
};

TEST_F(Seams, AnObjectiveOfOnesOwnIsTrainedAndLogged) {
  const TemporaryFolder folder;
  TrainExtensions extensions;
  extensions.objectives = {darkness(5)};
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  testing::internal::CaptureStderr();
  train_run(queue(), config(60), run, false, Start::fresh, extensions);
  const std::string progress = testing::internal::GetCapturedStderr();
  EXPECT_NE(progress.find("darkness 0."), std::string::npos) << progress;
  const std::string csv = contents(run.path("metrics.csv"));
  EXPECT_NE(csv.substr(0, csv.find('\n')).find(",darkness,"), std::string::npos) << csv;
  const std::string log = contents(run.path("metrics.jsonl"));
  EXPECT_NE(log.find("\"darkness\":0."), std::string::npos) << log;
}

TEST_F(Seams, AnObjectiveOfOnesOwnChangesTheModel) {
  const auto mean_color = [&](float weight) {
    TrainExtensions extensions;
    if (weight > 0) extensions.objectives = {darkness(weight)};
    const HostModel model =
        train(queue(), scene_in_memory(config(100)), config(100), extensions).model;
    double sum = 0;
    for (const float value : model.groups.at("sh0")) sum += double(value);
    return sum / double(model.count);
  };
  EXPECT_LT(mean_color(20), mean_color(0) - 0.1);
}

// Neither is used by gflow's own losses here.
TEST_F(Seams, AnObjectiveMayRequestFlowAndDepth) {
  TrainOptions without_flow = config(60);
  without_flow.flow.enabled = false;
  const auto trained = [&](bool pulled) {
    TrainExtensions extensions;
    if (pulled)
      extensions.objectives = {[](const TrainInputs&) { return std::make_unique<Nearness>(); }};
    return train(queue(), scene_in_memory(without_flow), without_flow, extensions);
  };
  const TrainResult pulled = trained(true);
  EXPECT_EQ(pulled.report.value("nonzero"), 0);
  EXPECT_GT(pulled.report.value("nearness"), 0);
  EXPECT_NE(pulled.model.groups.at("means"), trained(false).model.groups.at("means"));
}

// A loss on Gaussians instead of images.
TEST_F(Seams, AnObjectiveMayCompareThePosesOfGaussians) {
  const auto trained = [&](float weight) {
    TrainExtensions extensions;
    extensions.objectives = {
        [&](const TrainInputs&) { return std::make_unique<Stillness>(weight); }};
    return train(queue(), scene_in_memory(config(100)), config(100), extensions);
  };
  const TrainResult free = trained(0), held = trained(1);
  EXPECT_GT(held.report.value("views_with_t0"), 10);
  EXPECT_LT(held.report.value("views_with_t0"), 100);  // the first time step has none
  const auto speed = [](const TrainResult& result) {
    double sum = 0;
    for (const float v : result.model.groups.at("velocities")) sum += std::abs(double(v));
    return sum / double(result.model.count);
  };
  EXPECT_LT(speed(held), speed(free) / 3);
  EXPECT_GT(held.report.value("psnr"), 10);  // and the images still count
}

TEST_F(Seams, AnObserverSeesEveryStepAndMayStop) {
  Counter all, some(25);
  TrainExtensions extensions;
  extensions.observer = &all;
  const TrainResult whole = train(queue(), scene_in_memory(config(40)), config(40), extensions);
  ASSERT_EQ(all.seen.size(), 40u);
  EXPECT_EQ(all.seen.front(), 1);
  EXPECT_EQ(all.seen.back(), 40);
  EXPECT_EQ(all.last_loss, whole.report.loss);
  EXPECT_EQ(all.gaussians, whole.model.count);
  extensions.observer = &some;
  EXPECT_EQ(train(queue(), scene_in_memory(config(40)), config(40), extensions).steps, 25);
  EXPECT_EQ(some.seen.size(), 25u);
}

TEST_F(Seams, AnObserverTakesWarnings) {
  TrainOptions tight = config(2);
  tight.density.memory = 1;  // MiB
  tight.density.cap = 1000000;
  tight.motion.key_scales = true;  // has no effect
  Counter counter;
  TrainExtensions extensions;
  extensions.observer = &counter;
  testing::internal::CaptureStderr();
  train(queue(), scene_in_memory(tight), tight, extensions);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_EQ(counter.notices.size(), 2u);
  EXPECT_NE(counter.notices[0].find("motion.key_scales has no effect"), std::string::npos);
  EXPECT_NE(counter.notices[1].find("density.cap = 1000000"), std::string::npos);
}

TEST_F(Seams, TheObserverOfARunSeesFlowStepsAndWarnings) {
  const TemporaryFolder folder;
  TrainOptions computed = config(20);
  computed.flow.enabled = true;
  computed.flow.source = FlowSource::dis;
  computed.motion.key_scales = true;  // has no effect
  Counter counter;
  TrainExtensions extensions;
  extensions.observer = &counter;
  testing::internal::CaptureStderr();
  train_run(queue(), computed, RunFolder::create(folder.path() + "/run"), true, Start::fresh,
            extensions);
  const std::string printed = testing::internal::GetCapturedStderr();
  EXPECT_EQ(printed.find("warning"), std::string::npos) << printed;
  const size_t pairs = (SmallScene::cameras - 1) * (SmallScene::steps - 1);  // cam00 is for tests
  ASSERT_EQ(counter.flow.size(), pairs);
  EXPECT_EQ(counter.flow.back(), std::pair(pairs, pairs));
  EXPECT_EQ(counter.seen.size(), 20u);
  ASSERT_FALSE(counter.notices.empty());
  EXPECT_NE(counter.notices[0].find("motion.key_scales has no effect"), std::string::npos);
}

TEST_F(Seams, ASceneInMemoryTrainsToTheBitsOfItsFiles) {
  TrainOptions both = config(150);
  const TrainResult memory = train(queue(), scene_in_memory(both), both);
  SmallTraining files(queue(), both);
  files.steps(queue(), 150);
  const HostModel expected = files.model.read(queue());
  ASSERT_EQ(memory.model.count, expected.count);
  for (const auto& [name, values] : expected.groups)
    EXPECT_EQ(memory.model.groups.at(name), values);
  EXPECT_GT(memory.report.value("psnr"), 15);
}

TEST_F(Seams, ASceneInMemoryThatContradictsItselfIsAnError) {
  Scene scene = scene_in_memory(config(10));
  Frame& frame = scene.train[1];
  frame.image = std::make_shared<Image>(Image{3, 2, 3, std::vector<uint8_t>(18)});
  expect_error([&] { train(queue(), scene, config(10)); }, {frame.name, "3x2"});
}

}  // namespace
}  // namespace gflow
