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
  bool stop(int done) override { return done >= most_; }

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
  train_run(queue(), config(60), run, false, Start::anew, extensions);
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
