// SPDX-License-Identifier: Apache-2.0
// An external motion model: one class, one descriptor, one registration. It has settings and a
// parameter of its own, and is trained, saved, read and rendered like any other.
#include "optim/model/model.hpp"
#include "optim/motion/spacetime.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

// Static Gaussians in a world that drifts: all share one velocity, "drift" [1, 3], along the first
// `axes` axes, and are in place at the share `middle` of the video. Computed on the host.
class Drifting : public SpacetimeMotion {
 public:
  Drifting(Queue& queue, const MotionShape& shape)
      : SpacetimeMotion(queue, shape.cutoff),
        middle_(shape.own.real("middle") * shape.duration),
        axes_(size_t(shape.own.whole("axes"))) {}

  std::vector<TableSpec> tables() const override { return drift_tables(); }
  static std::vector<TableSpec> drift_tables() {
    TableSpec table;
    table.groups = {{"drift", 3, Quantity::position, 1}};
    table.rows = 1;
    return {table};
  }

  void at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
          GaussiansAt& gaussians, const RowList& rows) override {
    SpacetimeMotion::at(queue, p, middle_, seen, gaussians, rows);
    const std::vector<float> drift = p["drift"].values.read(queue);
    std::vector<float> means = gaussians.means.read(queue);
    for (size_t i = 0; i < means.size(); i += 3)
      for (size_t c = 0; c < axes_; ++c) means[i + c] += drift[c] * (t - middle_);
    gaussians.means.write(queue, means);
  }
  bool cull(Queue&, const Parameters&, float, const PinholeCamera&, ViewRows&) override {
    return false;
  }
  void backward(Queue& queue, Parameters& p, float t, bool first,
                const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                const RowList& rows) override {
    SpacetimeMotion::backward(queue, p, middle_, first, tiles_touched, v_means, v_factors,
                              v_opacities, rows);
    const std::vector<cl_uint> drawn = tiles_touched.read(queue);
    const std::vector<float> v = v_means.read(queue);
    Table& table = p.more[0];
    std::vector<float> v_drift(3, 0.f);
    if (table.rows.seen.read(queue)[0] > 0) v_drift = p["drift"].grads.read(queue);
    for (size_t i = 0; i < drawn.size(); ++i)
      for (size_t c = 0; c < axes_ && drawn[i] > 0; ++c) v_drift[c] += v[3 * i + c] * (t - middle_);
    p["drift"].grads.write(queue, v_drift);
    table.rows.seen.fill(queue, 1u);
    table.active = {0, 1};
  }

 private:
  float middle_;
  size_t axes_;
};

// A spacetime model with more to it, registered once for all tests.
MotionModelKind drifting() {
  static const MotionModel model = [] {
    MotionModel m = spacetime_model();
    m.name = "drifting";
    m.own = {{"middle", 0.5f, "share of the video at which Gaussians are in place", between(0, 1)},
             {"axes", 3, "number of axes along which the world may drift", between(1, 3)}};
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<Drifting>(queue, shape);
    };
    m.tables = [](const MotionShape&) { return Drifting::drift_tables(); };
    return m;
  }();
  static const MotionModelKind kind = register_motion_model(model);
  return kind;
}

class ToyMotionModel : public OnOneScene {};

TEST_F(ToyMotionModel, IsTrainedByItsName) {
  const MotionModelKind kind = drifting();
  TrainOptions options = small_config(scene(), 80);
  options.flow.enabled = false;
  for (const char* setting : {"motion.model=drifting", "drifting.middle=0.25", "drifting.axes=2"})
    apply_setting(options, setting);
  HostModel model = train(queue(), read_scene(options.scene.path, options.scene), options).model;
  EXPECT_EQ(model.shape.motion, kind);
  const std::vector<float>& drift = model.groups.at("drift");
  ASSERT_EQ(drift.size(), 3u);
  EXPECT_NE(drift[0], 0);
  EXPECT_NE(drift[1], 0);
  EXPECT_EQ(drift[2], 0);

  // Files hold its name, its numbers and its parameter.
  const TemporaryFolder folder;
  write_model(folder.file("drifting.ply"), model);
  HostModel back = read_model(folder.file("drifting.ply"));
  EXPECT_EQ(back.shape.motion, kind);
  EXPECT_EQ(back.shape.own.real("middle"), 0.25f);
  EXPECT_EQ(back.shape.own.whole("axes"), 2);
  EXPECT_EQ(back.groups.at("drift"), drift);

  // It renders: all Gaussians of the second image stand where the drift took them.
  back.groups.at("drift") = {2, 0, 0};
  Model on_device(queue(), back);
  Renderer renderer(queue(), {});
  const auto means = [&](double time) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(small_camera(1, 48, 40), 0.05f);
    shot.time = time;
    renderer.forward(queue(), on_device, shot);
    return renderer.gaussians().means.read(queue());
  };
  const std::vector<float> early = means(0.25), late = means(0.75);
  for (size_t i = 0; i < early.size(); i += 3) {
    EXPECT_NEAR(late[i] - early[i], back.shape.duration, 1e-5 * back.shape.duration);
    EXPECT_EQ(late[i + 1], early[i + 1]);
  }
}

TEST_F(ToyMotionModel, ItsNumbersAreSettings) {
  drifting();
  TrainOptions options;
  EXPECT_EQ(setting_values(options).at("drifting.axes"), "3");
  apply_text(options, "[drifting]\nmiddle = 0.75\n", "text");
  EXPECT_EQ(to_toml(options).find("[drifting]"), std::string::npos);  // not its model
  apply_setting(options, "motion.model=drifting");
  TrainOptions back;
  apply_text(back, to_toml(options), "text");
  EXPECT_EQ(setting_values(back).at("drifting.middle"), "0.75");
  expect_error([&] { apply_setting(options, "drifting.axes=4"); }, {"drifting.axes = 4", "1 to 3"});
}

TEST_F(ToyMotionModel, ANameIsRegisteredOnce) {
  drifting();
  static const MotionModel again = spacetime_model();
  expect_error([] { register_motion_model(again); }, {"spacetime", "already"});
}

}  // namespace
}  // namespace gflow
