// SPDX-License-Identifier: Apache-2.0
// An external motion model: one class, one descriptor, one registration. It is trained, saved, read
// and rendered like any other.
#include "optim/model/model.hpp"
#include "optim/motion/spacetime.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

// The Gaussians at the middle of the video, at every time.
class Frozen : public SpacetimeMotion {
 public:
  Frozen(Queue& queue, const MotionShape& shape)
      : SpacetimeMotion(queue, shape.cutoff), middle_(shape.duration / 2) {}

  void at(Queue& queue, const Parameters& parameters, float, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows) override {
    SpacetimeMotion::at(queue, parameters, middle_, seen, gaussians, rows);
  }
  bool look(Queue& queue, const Parameters& parameters, float, const PinholeCamera& camera,
            ViewRows& rows) override {
    return SpacetimeMotion::look(queue, parameters, middle_, camera, rows);
  }
  void backward(Queue& queue, Parameters& parameters, float, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows) override {
    SpacetimeMotion::backward(queue, parameters, middle_, first, tiles_touched, v_means, v_factors,
                              v_opacities, rows);
  }

 private:
  float middle_;
};

// The descriptor of spacetime under another name, registered once for all tests.
MotionModelKind frozen() {
  static const MotionModel model = [] {
    MotionModel m = spacetime_model();
    m.name = "frozen";
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<Frozen>(queue, shape);
    };
    return m;
  }();
  static const MotionModelKind kind = register_motion_model(model);
  return kind;
}

class ToyMotionModel : public OnOneScene {};

TEST_F(ToyMotionModel, IsTrainedByItsName) {
  const MotionModelKind kind = frozen();
  TrainOptions options = small_config(scene(), 80);
  options.flow.enabled = false;
  apply_setting(options, "motion.model=frozen");
  HostModel model = train(queue(), read_scene(options.scene.path, options.scene), options).model;
  EXPECT_EQ(model.shape.motion, kind);

  // It renders the same image at all times.
  Model on_device(queue(), model);
  Renderer renderer(queue(), {});
  const auto drawn = [&](double time) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(small_camera(1, 48, 40), 0.05f);
    shot.time = time;
    renderer.forward(queue(), on_device, shot);
    return renderer.images().rgb.read(queue());
  };
  EXPECT_EQ(drawn(0), drawn(1));

  // Files contain its name.
  const TemporaryFolder folder;
  write_model(folder.file("frozen.ply"), model);
  const HostModel back = read_model(folder.file("frozen.ply"));
  EXPECT_EQ(back.shape.motion, kind);
  EXPECT_EQ(back.groups.at("velocities"), model.groups.at("velocities"));
}

TEST_F(ToyMotionModel, ANameIsRegisteredOnce) {
  frozen();
  static const MotionModel again = spacetime_model();
  expect_error([] { register_motion_model(again); }, {"spacetime", "already"});
}

}  // namespace
}  // namespace gflow
