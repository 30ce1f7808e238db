// SPDX-License-Identifier: Apache-2.0
// A camera that rotates in front of a static wall: all flow is the camera's.
#include <fmt/format.h>

#include "optim/eval/evaluation.hpp"
#include "optim/eval/views.hpp"
#include "tests/support/blender_frame.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

constexpr int steps = 5;

HostModel wall() {
  HostModel model;
  model.shape.sh_degree = 0;
  model.shape.duration = 1;
  for (uint i = 0; i < 140; ++i)
    append_gaussian(model, {-3.25f + 0.5f * float(i % 14), -2.25f + 0.5f * float(i / 14), 1}, 0.25f,
                    some_color(100 + i), 0);
  return model;
}

// It rotates by `degrees` per frame and never faces the wall squarely: the depth order of the
// Gaussians, and so the image, would change there. Written as a Blender folder with the same images
// for training and test.
class PanScene {
 public:
  PanScene(Queue& queue, double degrees) : truth(wall()) {
    Model model(queue, truth);
    Renderer renderer(queue, {});
    std::string frames;
    for (int k = 0; k < steps; ++k) {
      const Camera camera = turned(degrees * (k + 1));
      Shot shot;
      shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
      shot.time = double(k) / (steps - 1);
      renderer.forward(queue, model, shot);
      const std::vector<float> rgb = renderer.images().rgb.read(queue);
      write_png(folder_.file(fmt::format("train/{}.png", k)),
                image_of_rgb(camera.width, camera.height, rgb));
      frames += (k ? "," : "") +
                blender_frame(camera, fmt::format("train/{}", k), double(k) / (steps - 1));
    }
    for (const char* split : {"train", "test"})
      folder_.write(fmt::format("transforms_{}.json", split),
                    fmt::format(R"({{"fl_x": 52.8, "frames": [{}]}})", frames));
    config.scene.path = folder_.path();
    config.init.dynamic = 0;
    config.motion.sh_degree = 0;
    loaded = load_scene(config.scene, "");
  }

  HostModel truth;
  TrainOptions config;
  LoadedScene loaded;

 private:
  static Camera turned(double degrees) {
    Camera camera = small_camera(0, 48, 40);
    const Eigen::AngleAxisd turn(degrees * M_PI / 180, Eigen::Vector3d::UnitY());
    camera.viewmat.topLeftCorner<3, 3>() = turn.toRotationMatrix();
    camera.viewmat.topRightCorner<3, 1>() = turn * Eigen::Vector3d(0, 0, 3);
    return camera;
  }

  TemporaryFolder folder_;
};

// Displacement of a pixel when the camera rotates: independent of depth.
TargetFlow flow_by_turning(const Camera& from, const Camera& to) {
  TargetFlow target_flow{zero_flow(from.width, from.height), {}};
  target_flow.confidence.assign(target_flow.flow.valid.size(), 255);
  for (int y = 0; y < from.height; ++y)
    for (int x = 0; x < from.width; ++x) {
      const Eigen::Vector2d pixel(x + 0.5, y + 0.5);
      const Eigen::Vector3d ray((pixel.x() - from.cx) / from.fx, (pixel.y() - from.cy) / from.fy,
                                1);
      const Eigen::Vector3d world =
          from.position() + from.viewmat.topLeftCorner<3, 3>().transpose() * ray;
      const Eigen::Vector2d flow = to.project(world) - pixel;
      const size_t i = size_t(y) * size_t(from.width) + size_t(x);
      target_flow.flow.uv[2 * i] = float(flow.x());
      target_flow.flow.uv[2 * i + 1] = float(flow.y());
    }
  return target_flow;
}

TEST(MovingCamera, TrainingSeesTheFlowOfTheCamera) {
  Queue queue = test_queue();
  PanScene made(queue, 2);
  const Scene& scene = made.loaded.scene;
  std::vector<FlowPair> pairs = neighbour_pairs(scene);
  ASSERT_EQ(pairs.size(), size_t(steps - 1));
  for (const FlowPair& pair : reversed(pairs)) pairs.push_back(pair);
  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs)
    loaders.emplace_back([&scene, pair] {
      return flow_by_turning(scene.cameras[size_t(scene.train[size_t(pair.frame)].camera)],
                             scene.cameras[size_t(scene.train[size_t(pair.next)].camera)]);
    });
  FlowStore flows(loaders);
  EXPECT_GT(std::abs(flows.get(0)->flow.uv[2 * (20 * 48 + 24)]), 1.8);  // 52.8 px x tan 2 degrees

  Model model(queue, made.truth);
  Trainer trainer({queue, made.config, scene, *made.loaded.frames, pairs, flows, model},
                  std::vector<Rect>(scene.train.size()));
  for (int step = 0; step < 2 * steps; ++step) {  // each frame twice
    trainer.step(queue, made.config.flow.start + step);
    const double epe = trainer.report(queue).value("flow_epe");
    EXPECT_GT(epe, 0);
    // Gaussians of 3 px move as affine maps: 3 standard deviations differ by (9 / 53)^2 of 1.9 px.
    EXPECT_LT(epe, 0.06);
  }
}

TEST(MovingCamera, EvaluationComparesTheFlowOfBothCameras) {
  Queue queue = test_queue();
  PanScene made(queue, 2);
  Model model(queue, made.truth);
  const Evaluation evaluation =
      evaluate(queue, model, made.config, made.loaded, made.loaded.scene.test, {});
  EXPECT_EQ(evaluation.flow_reference, "dis");
  for (size_t k = 0; k + 1 < steps; ++k)
    EXPECT_LT(evaluation.views[k].flow_epe, 0.1) << k;  // DIS's error; a static camera has 1.8
  EXPECT_TRUE(std::isnan(evaluation.views[steps - 1].flow_epe));
}

TEST(MovingCamera, ViewsLookFromTheNextImagesCamera) {
  Queue queue = test_queue();
  PanScene made(queue, 2);
  Scene& scene = made.loaded.scene;
  const std::vector<Camera>& cameras = made.loaded.frames->cameras();
  std::vector<RenderView> views = split_views(scene, scene.test, cameras, "test");
  ASSERT_EQ(views.size(), size_t(steps));
  for (size_t k = 0; k + 1 < steps; ++k) {
    EXPECT_EQ(views[k].movie, "test");
    EXPECT_EQ(views[k].truth_t2, &scene.test[k + 1]);
    EXPECT_EQ(views[k].camera_t2.viewmat, views[k + 1].camera.viewmat);
    EXPECT_NE(views[k].camera_t2.viewmat, views[k].camera.viewmat);
  }
  // True flow is that of a static camera.
  scene.test[1].flow_path = "true.flo";
  scene.test[1].flow_time = scene.test[2].time;
  views = split_views(scene, scene.test, cameras, "test");
  EXPECT_EQ(views[1].camera_t2.viewmat, views[1].camera.viewmat);
  EXPECT_EQ(views[1].truth_t2, nullptr);
}

TEST(MovingCamera, OneThatTeleportsHasNoFlow) {
  Queue queue = test_queue();
  PanScene made(queue, 15);
  EXPECT_TRUE(neighbour_pairs(made.loaded.scene).empty());
  Model model(queue, made.truth);
  EXPECT_EQ(
      evaluate(queue, model, made.config, made.loaded, made.loaded.scene.test, {}).flow_reference,
      "none");
}

}  // namespace
}  // namespace gflow
