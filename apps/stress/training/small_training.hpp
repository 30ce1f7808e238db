// SPDX-License-Identifier: Apache-2.0
// A scene small enough to train in seconds, rendered from known Gaussians: a textured blob that
// crosses a wall (or, with alpha, nothing); four cameras, five steps, true flow. Written as an N3V
// folder; cam00 is the test camera.
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "optim/eval/shown_images.hpp"
#include "optim/formats/npy.hpp"
#include "optim/images/image.hpp"
#include "optim/init/init.hpp"
#include "optim/runs/train_run.hpp"
#include "runtime/files/temporary_folder.hpp"
#include "shared/random.h"
#include "shared/sh.h"

namespace gflow {

// Deterministic numbers in [-1, 1] for Gaussian i.
inline float noise(uint stream, uint i) { return float(2 * random_uniform(5u, stream, i) - 1); }

// Appends an unrotated Gaussian that exists at all times and moves at `speed` along x.
inline void append_gaussian(HostModel& model, const Eigen::Vector3f& mean, float scale,
                            const Eigen::Vector3f& color, float speed) {
  auto& g = model.groups;
  ++model.count;
  const auto put = [&](const char* name, std::initializer_list<float> values) {
    g[name].insert(g[name].end(), values);
  };
  put("means", {mean.x(), mean.y(), mean.z()});
  put("means_t", {0.5f * model.shape.duration});
  put("quats", {1, 0, 0, 0});
  put("velocities", {speed, 0, 0});
  put("half_accelerations", {0, 0, 0});
  put("turns", {0, 0, 0, 0});
  const float s = std::log(scale);
  put("log_scales", {s, s, s, std::log(1000 * model.shape.duration)});
  put("logit_opacities", {3});
  put("sh0", {(color.x() - 0.5f) / SH_C0, (color.y() - 0.5f) / SH_C0, (color.z() - 0.5f) / SH_C0});
  g["sh_rest"];
}

inline Eigen::Vector3f some_color(uint i) {
  return {0.5f + 0.4f * noise(0, i), 0.5f + 0.4f * noise(1, i), 0.5f + 0.4f * noise(2, i)};
}

constexpr float blob_path = 0.6f;  // [scene units]; distance the blob covers in the video

// 14 moving Gaussians, and 80 static ones behind them.
inline HostModel small_model(bool with_wall) {
  HostModel model;
  model.shape.sh_degree = 0;
  model.shape.duration = 1;
  for (uint i = 0; i < 14; ++i)
    append_gaussian(model, {0.25f * noise(3, i), 0.25f * noise(4, i), 0.1f * noise(5, i)}, 0.1f,
                    some_color(i), blob_path);
  if (with_wall)
    for (uint i = 0; i < 80; ++i)
      append_gaussian(model, {-2.25f + 0.5f * float(i % 10), -1.75f + 0.5f * float(i / 10), 1},
                      0.25f, some_color(100 + i), 0);
  return model;
}

// Camera i of 4, looking at the origin from about 3 units away; y points down.
inline Camera small_camera(int i, int width, int height) {
  const double x[] = {0.1, -0.8, 0.7, 0.05}, y[] = {0.05, -0.3, -0.4, 0.6};
  Camera camera;
  camera.name = "cam0" + std::to_string(i);
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 1.1 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  const Eigen::Vector3d position(x[i], y[i], -3), down(0, 1, 0);
  const Eigen::Vector3d ahead = -position.normalized(), right = down.cross(ahead).normalized();
  Eigen::Matrix3d rotation;
  rotation << right, ahead.cross(right), ahead;
  camera.viewmat.topLeftCorner<3, 3>() = rotation.transpose();
  camera.viewmat.topRightCorner<3, 1>() = -rotation.transpose() * position;
  return camera;
}

class SmallScene {
 public:
  static constexpr int cameras = 4, steps = 5;

  explicit SmallScene(Queue& queue, bool with_alpha = false, int width = 48, int height = 40)
      : truth(small_model(!with_alpha)), with_alpha_(with_alpha) {
    Model model(queue, truth);
    Renderer renderer(queue, {});
    for (int c = 0; c < cameras; ++c)
      for (int k = 0; k < steps; ++k)
        draw(queue, model, renderer, small_camera(c, width, height), k);
    write_poses(width, height);
    write_points();
  }

  const std::string& path() const { return folder_.path(); }
  const ScratchFolder& folder() const { return folder_; }

  HostModel truth;

 private:
  void draw(Queue& queue, Model& model, Renderer& renderer, const Camera& camera, int k) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
    shot.time = double(k) / (steps - 1);
    shot.time_t2 = double(k + 1) / (steps - 1);
    shot.flow = k + 1 < steps;
    if (with_alpha_) shot.background = {0, 0, 0};
    renderer.forward(queue, model, shot);
    const Images& images = renderer.images();
    Image image = image_of_rgb(images.width, images.height, images.rgb.read(queue));
    const std::vector<float> alpha = images.alpha.read(queue);
    if (with_alpha_) image = with_straight_alpha(image, alpha);
    const std::string step = "000" + std::to_string(k);
    write_png(folder_.file(camera.name + "/images/" + step + ".png"), image);
    if (shot.flow)
      write_flo(folder_.file("flow/" + camera.name + "/" + step + ".flo"),
                flow_of_planes(images.width, images.height, images.flow.read(queue), alpha));
  }

  static Image with_straight_alpha(const Image& rgb, const std::vector<float>& alpha) {
    Image image{rgb.width, rgb.height, 4, {}};
    for (size_t i = 0; i < alpha.size(); ++i) {
      for (size_t c = 0; c < 3; ++c)
        image.pixels.push_back(
            uint8_t(std::min(255.f, float(rgb.pixels[3 * i + c]) / std::max(alpha[i], 0.004f))));
      image.pixels.push_back(uint8_t(std::lround(255 * std::min(alpha[i], 1.f))));
    }
    return image;
  }

  void write_poses(int width, int height) const {
    std::vector<double> rows;
    for (int c = 0; c < cameras; ++c) {
      const Camera camera = small_camera(c, width, height);
      const Eigen::Matrix3d world = camera.viewmat.topLeftCorner<3, 3>().transpose();
      const Eigen::Vector3d p = camera.position();
      const double size[3] = {double(height), double(width), camera.fx};
      for (int r = 0; r < 3; ++r)  // down, right, backward, position, size
        rows.insert(rows.end(), {world(r, 1), world(r, 0), -world(r, 2), p[r], size[r]});
      rows.insert(rows.end(), {1, 10});
    }
    write_npy(folder_.file("poses_bounds.npy"), {{size_t(cameras), 17}, rows});
  }

  // The Gaussians' positions at the middle of the video with some noise; grey.
  void write_points() const {
    PointCloud points;
    for (size_t i = 0; i < 3 * truth.count; ++i) {
      points.xyz.push_back(truth.groups.at("means")[i] + 0.03f * noise(7, uint(i)));
      points.rgb.push_back(128);
    }
    write_point_cloud(folder_.file("points3D.ply"), points);
  }

  const ScratchFolder folder_{"stress"};
  bool with_alpha_;
};

// Settings that suit the scene: everything happens within some hundred steps.
inline TrainOptions small_config(const SmallScene& scene, int iterations) {
  TrainOptions config;
  config.scene.path = scene.path();
  config.train.iterations = iterations;
  config.train.seed = 3;
  config.motion.sh_degree = 1;
  config.motion.sh_interval = 100;
  config.init.dynamic = 0;
  config.lr.motion = 8;  // Gaussians exist throughout the video and must learn their whole path
  config.flow.source = FlowSource::files;  // the scene's true flow
  config.density.start = 100;
  config.density.every = 50;
  config.density.cap = 300;
  return config;
}

// A training without a run folder.
class SmallTraining {
 public:
  SmallTraining(Queue& queue, const TrainOptions& config, Guidance* guidance = nullptr)
      : config(config),
        loaded(load_scene(config.scene, "")),
        pairs(config.flow.enabled ? neighbour_pairs(loaded.scene) : std::vector<FlowPair>{}),
        flows(true_flows(loaded.scene, pairs, *loaded.frames)),
        static_cameras(static_cameras_of(loaded.scene, *loaded.frames)),
        parts(parts_of_interest(loaded.scene, *loaded.frames, static_cameras)),
        model(queue, initial_model(loaded.scene, *loaded.frames, parts, static_cameras, pairs,
                                   flows, config)),
        trainer({queue, this->config, loaded.scene, *loaded.frames, pairs, flows, model, guidance},
                parts) {}

  void steps(Queue& queue, int count) {
    for (int i = 0; i < count; ++i) trainer.step(queue, done_++);
  }

  // All state that training changes, by name, as bits.
  std::map<std::string, std::vector<uint32_t>> bits(Queue& queue) {
    std::map<std::string, std::vector<uint32_t>> all;
    for (const auto& [name, array] : trainer.state(queue))
      std::visit([&, &name = name](const auto& values) { all[name] = bits_of(values); },
                 array.values);
    return all;
  }
  // Continues from a state as if `done` steps had been made.
  void go_on(Queue& queue, const Arrays& state, int done) {
    trainer.set_state(queue, state, "a state");
    done_ = done;
  }

  TrainOptions config;
  LoadedScene loaded;
  std::vector<FlowPair> pairs;
  FlowStore flows;
  std::vector<StaticCamera> static_cameras;
  std::vector<Rect> parts;
  Model model;
  Trainer trainer;

 private:
  template <class T>
  static std::vector<uint32_t> bits_of(const std::vector<T>& values) {
    std::vector<uint32_t> bits(values.size() * sizeof(T) / 4);
    if (!bits.empty()) std::memcpy(bits.data(), values.data(), 4 * bits.size());
    return bits;
  }
  int done_ = 0;
};

}  // namespace gflow
