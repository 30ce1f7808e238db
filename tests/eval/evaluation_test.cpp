// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/evaluation.hpp"

#include "optim/eval/metric_networks.hpp"
#include "optim/flow/estimated_flow.hpp"
#include "optim/loss/metrics.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

Evaluation evaluated(Queue& queue, const SmallScene& scene, const HostModel& host) {
  const TrainOptions config = small_config(scene, 1);
  LoadedScene loaded = load_scene(config.scene, "");
  Model model(queue, host);
  return evaluate(queue, model, config, loaded, loaded.scene.test, {});
}

// Against its own images a model errs by their rounding to 8 bits: uniform within half a step,
// variance 1 / (12 x 255^2), that is 58.9 dB; SSIM differs by less than 1e-3.
TEST(Evaluate, FindsNoErrorInTheModelThatDrewTheImages) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const Evaluation evaluation = evaluated(queue, scene, scene.truth);
  EXPECT_EQ(evaluation.flow_reference, "true");
  EXPECT_FALSE(evaluation.trained_on);
  ASSERT_EQ(evaluation.views.size(), size_t(SmallScene::steps));
  for (const ViewMetrics& view : evaluation.views) {
    EXPECT_NEAR(view.psnr, 58.9, 1) << view.name;
    EXPECT_GT(view.ssim, 0.999) << view.name;
  }
  // Its own flow under the settings of the configuration, which produced the images.
  EXPECT_LT(evaluation.mean.flow_epe, 1e-5);
  EXPECT_LT(evaluation.mean.flow_epe_dynamic, 1e-5);
  EXPECT_NEAR(evaluation.mean.psnr_dynamic, 58.9, 1);
}

TEST(Evaluate, HasNoFlowMetricsWhereNoFlowLeads) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const Evaluation evaluation = evaluated(queue, scene, scene.truth);
  const ViewMetrics& last = evaluation.views.back();  // the last step has no next frame
  EXPECT_TRUE(std::isnan(last.flow_epe));
  EXPECT_TRUE(std::isnan(last.flow_epe_dynamic));
  EXPECT_TRUE(std::isnan(last.psnr_dynamic));
  EXPECT_TRUE(std::isfinite(evaluation.mean.flow_epe));  // mean of the views with a value
}

// The flow error of a static model is the mean length of the true flow, over the pixels that move
// by more than 1 px.
TEST(Evaluate, DynamicPixelsAreThoseWhoseTrueFlowExceedsOnePixel) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  HostModel still = scene.truth;
  set_static(still.shape, still.groups, still.count);
  const Evaluation evaluation = evaluated(queue, scene, still);

  const LoadedScene loaded = load_scene(small_config(scene, 1).scene, "");
  for (size_t k = 0; k + 1 < loaded.scene.test.size(); ++k) {
    const FlowField truth = read_flo(loaded.scene.test[k].flow_path);
    double all = 0, moving = 0;
    size_t pixels = 0;
    for (size_t i = 0; i < truth.valid.size(); ++i) {
      const double length = std::hypot(truth.uv[2 * i], truth.uv[2 * i + 1]);
      all += length;
      if (length > 1) moving += length, ++pixels;
    }
    ASSERT_GT(pixels, 20u);
    // The model's own flow is 0 up to rounding; sums of 2000 terms in double.
    EXPECT_NEAR(evaluation.views[k].flow_epe, all / double(truth.valid.size()), 1e-5);
    EXPECT_NEAR(evaluation.views[k].flow_epe_dynamic, moving / double(pixels), 1e-5);
    EXPECT_LT(evaluation.views[k].psnr_dynamic, evaluation.views[k].psnr);
  }
}

// Like the loss, the evaluation ignores impossible flow.
TEST(Evaluate, FlowOfAHundredThousandPixelsIsNoTruth) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const Evaluation before = evaluated(queue, scene, scene.truth);
  const LoadedScene loaded = load_scene(small_config(scene, 1).scene, "");
  for (size_t k = 0; k + 1 < loaded.scene.test.size(); ++k) {
    FlowField truth = read_flo(loaded.scene.test[k].flow_path);
    for (const size_t i : {size_t(3), size_t(40), size_t(41)}) truth.uv[2 * i + i % 2] = 1e9f;
    write_flo(loaded.scene.test[k].flow_path, truth);
  }
  const Evaluation after = evaluated(queue, scene, scene.truth);
  for (size_t k = 0; k + 1 < loaded.scene.test.size(); ++k)
    EXPECT_NEAR(after.views[k].flow_epe, before.views[k].flow_epe, 1e-4);
}

// A model whose moving Gaussians have other colours; its rendered images are read again, in 8 bits.
TEST(Evaluate, SsimOfWhatMovesIsTheMeanOverThesePixels) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  HostModel other = scene.truth;
  for (size_t i = 0; i < 3 * 14; ++i) other.groups.at("sh0")[i] *= -1;
  const TrainOptions config = small_config(scene, 1);
  const LoadedScene loaded = load_scene(config.scene, "");
  Model model(queue, other);
  const TemporaryFolder drawn;
  const Evaluation evaluation =
      evaluate(queue, model, config, loaded, loaded.scene.test, {}, drawn.path());
  const ViewMetrics& view = evaluation.views[1];
  const FlowField flow = read_flo(loaded.scene.test[1].flow_path);
  std::vector<uint8_t> moving;
  for (size_t i = 0; i < flow.valid.size(); ++i)
    moving.push_back(std::hypot(flow.uv[2 * i], flow.uv[2 * i + 1]) > 1);
  const auto planar = [](const std::string& path) {
    const Image image = read_image(path);
    return PlanarImage::from_bytes(image.width, image.height, image.pixels);
  };
  EXPECT_NEAR(view.ssim_dynamic,
              ssim(planar(drawn.path() + "/" + view.name + ".png"),
                   planar(loaded.scene.test[1].path), moving),
              2e-3);
  EXPECT_LT(view.ssim_dynamic, view.ssim - 0.05);
}

// The error of a static model is the length of the truth, which is always more than 5 % of it.
TEST(Evaluate, FlAllIsTheShareOfPixelsOffByMoreThanThree) {
  Queue queue = test_queue();
  const SmallScene scene(queue, false, 96, 80);
  HostModel still = scene.truth;
  set_static(still.shape, still.groups, still.count);
  const Evaluation evaluation = evaluated(queue, scene, still);
  const LoadedScene loaded = load_scene(small_config(scene, 1).scene, "");
  for (size_t k = 0; k + 1 < loaded.scene.test.size(); ++k) {
    const FlowField truth = read_flo(loaded.scene.test[k].flow_path);
    size_t off = 0;
    for (size_t i = 0; i < truth.valid.size(); ++i)
      off += std::hypot(truth.uv[2 * i], truth.uv[2 * i + 1]) > 3;
    ASSERT_GT(off, 20u);
    EXPECT_NEAR(evaluation.views[k].fl_all, double(off) / double(truth.valid.size()), 1e-12);
  }
  EXPECT_TRUE(std::isnan(evaluation.views.back().fl_all));
  EXPECT_EQ(evaluated(queue, scene, scene.truth).mean.fl_all, 0);
}

// True depth of one view, a fifth less than the depth of the model that rendered the images.
TEST(Evaluate, ComparesDepthWhereThereIsATruth) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  EXPECT_TRUE(std::isnan(evaluated(queue, scene, scene.truth).mean.depth_error));
  Model model(queue, scene.truth);
  Renderer renderer(queue, {});
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(small_camera(0, 48, 40), 0.05f);
  shot.time = 0.25;
  shot.depth = true;
  renderer.forward(queue, model, shot);
  const std::vector<float> alpha = renderer.images().alpha.read(queue);
  std::vector<float> depth = expected_depth(renderer.images().depth.read(queue), alpha);
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = alpha[i] > 0.5f ? 0.8f * depth[i] : 0.f;
  write_npy(scene.folder().file("depth/cam00/0001.npy"), {{40, 48}, depth});
  const Evaluation evaluation = evaluated(queue, scene, scene.truth);
  EXPECT_NEAR(evaluation.views[1].depth_error, 0.25, 1e-5);
  EXPECT_TRUE(std::isnan(evaluation.views[0].depth_error));
  EXPECT_NEAR(evaluation.mean.depth_error, 0.25, 1e-5);
  write_npy(scene.folder().file("depth/cam00/0001.npy"), {{48, 40}, depth});
  expect_error([&] { evaluated(queue, scene, scene.truth); }, {"0001.npy"});
}

// The model is exact; one of five images is brightened by 20 of 255. So the error changes from and
// to this image, elsewhere only by the rounding of both images.
TEST(Evaluate, FlickerIsTheChangeOfTheErrorOnTheWayToTheNextView) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const std::string path = scene.path() + "/cam00/images/0002.png";
  Image image = read_image(path);
  for (uint8_t& value : image.pixels) value = uint8_t(std::min(255, value + 20));
  write_png(path, image);
  const Evaluation evaluation = evaluated(queue, scene, scene.truth);
  EXPECT_LT(evaluation.views[0].flicker, 0.5);
  EXPECT_NEAR(evaluation.views[1].flicker, 20, 0.5);
  EXPECT_NEAR(evaluation.views[2].flicker, 20, 0.5);
  EXPECT_LT(evaluation.views[3].flicker, 0.5);
  EXPECT_TRUE(std::isnan(evaluation.views[4].flicker));
  EXPECT_NEAR(evaluation.mean.flicker, 10, 0.5);
}

TEST(Evaluate, UsesDisWhereTheSceneHasNoTrueFlow) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  std::filesystem::remove_all(scene.path() + "/flow");
  const Evaluation evaluation = evaluated(queue, scene, scene.truth);
  EXPECT_EQ(evaluation.flow_reference, "dis");
  EXPECT_TRUE(std::isfinite(evaluation.mean.flow_epe));
  EXPECT_TRUE(std::isnan(evaluation.mean.teacher_epe_dynamic));  // it would be compared with itself
  EXPECT_LT(evaluation.mean.flicker, 1);
}

const std::string evaluation_networks = GFLOW_SOURCE_DIR "/tests/data/networks/";

TEST(Evaluate, AsksTheNetworksThatAreGiven) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const Evaluation without = evaluated(queue, scene, scene.truth);
  EXPECT_EQ(without.lpips_model + without.clip_model, "");
  EXPECT_TRUE(std::isnan(without.mean.lpips));
  EXPECT_TRUE(std::isnan(without.mean.clip));
  TrainOptions config = small_config(scene, 1);
  config.metrics.lpips = evaluation_networks + "lpips.onnx";
  config.metrics.clip = evaluation_networks + "clip.onnx";
  LoadedScene loaded = load_scene(config.scene, "");
  Model model(queue, scene.truth);
  try {
    MetricNetworks metric_networks(config.metrics);
  } catch (const Error& problem) {
    ASSERT_NE(std::string(problem.what()).find("libopencv-dnn-dev"), std::string::npos);
    GTEST_SKIP() << "built without OpenCV's dnn module";
  }
  const Evaluation evaluation = evaluate(queue, model, config, loaded, loaded.scene.test, {});
  EXPECT_EQ(evaluation.lpips_model, config.metrics.lpips);
  for (const ViewMetrics& view : evaluation.views) {
    EXPECT_GT(view.lpips, 0);  // this network is not symmetric
    EXPECT_NEAR(view.clip, 1, 1e-4);
  }
  EXPECT_EQ(evaluation.mean.psnr, without.mean.psnr);
  config.metrics.lpips = evaluation_networks + "lpips_6x4.onnx";
  expect_error([&] { evaluate(queue, model, config, loaded, loaded.scene.test, {}); },
               {"metrics.lpips", "6x4", "48x40"});
}

// The training views of a scene with transparent images, named like the test views of a plain
// video; their flow may be stored in a folder.
struct KeptFlow {
  explicit KeptFlow(Queue& queue) : scene(queue, true), config(small_config(scene, 1)) {
    std::filesystem::remove_all(scene.path() + "/flow");
    loaded = load_scene(config.scene, "");
  }
  void keep() {
    FlowEstimation how;
    how.folder = folder.path();
    estimated_flows(loaded.scene, neighbour_pairs(loaded.scene), *loaded.frames, how);
  }
  Evaluation evaluated(Queue& queue) {
    Model model(queue, scene.truth);
    std::vector<Frame> views = loaded.scene.train;
    for (Frame& view : views) view.name = "test_" + view.name;
    return evaluate(queue, model, config, loaded, views, {}, "", folder.path());
  }

  SmallScene scene;
  TrainOptions config;
  LoadedScene loaded;
  TemporaryFolder folder;
};

TEST(Evaluate, FindsTheSameWithFlowThatTrainingKeptAsWithout) {
  Queue queue = test_queue();
  KeptFlow kept(queue);
  const Evaluation without = kept.evaluated(queue);
  EXPECT_EQ(kept.folder.count(), 0u);  // the evaluation stores nothing itself
  kept.keep();
  const Evaluation with = kept.evaluated(queue);
  EXPECT_EQ(with.flow_reference, "dis");
  EXPECT_TRUE(with.trained_on);
  size_t compared = 0;
  for (size_t i = 0; i < with.views.size(); ++i)
    if (std::isfinite(without.views[i].flow_epe)) {
      EXPECT_EQ(with.views[i].flow_epe, without.views[i].flow_epe) << i;
      ++compared;
    }
  EXPECT_EQ(compared, 12u);  // three cameras, four pairs of steps
}

TEST(Evaluate, ReadsTheFlowThatIsKept) {
  Queue queue = test_queue();
  KeptFlow kept(queue);
  kept.keep();
  const Evaluation right = kept.evaluated(queue);
  const Frame& frame = kept.loaded.scene.train[0];
  TargetFlow far{zero_flow(48, 40), std::vector<uint8_t>(48 * 40, 255)};
  far.flow.uv.assign(far.flow.uv.size(), 100.f);
  FlowFolder(kept.folder.path(), uint64_t{1} << 30, {}).keep(frame.name, packed(far));
  const Evaluation wrong = kept.evaluated(queue);
  EXPECT_GT(wrong.views[0].flow_epe, 100);
  EXPECT_EQ(wrong.views[1].flow_epe, right.views[1].flow_epe);
}

// So that trainings with and without flow can be compared where something moves.
TEST(Evaluate, ComparesFlowOfATrainingWithoutItWhereTheCameraStandsStill) {
  Queue queue = test_queue();
  KeptFlow kept(queue);
  kept.config.flow.enabled = false;
  const Evaluation evaluation = kept.evaluated(queue);
  EXPECT_EQ(evaluation.flow_reference, "dis");
  EXPECT_TRUE(std::isfinite(evaluation.mean.flow_epe));
  EXPECT_TRUE(std::isfinite(evaluation.mean.psnr_dynamic));
}

TEST(Evaluate, SaysHowFarItIs) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TrainOptions config = small_config(scene, 1);
  LoadedScene loaded = load_scene(config.scene, "");
  Model model(queue, scene.truth);
  std::vector<size_t> calls;
  evaluate(queue, model, config, loaded, loaded.scene.test, [&](size_t done, size_t total) {
    EXPECT_EQ(total, 5u);
    calls.push_back(done);
  });
  EXPECT_EQ(calls, (std::vector<size_t>{1, 2, 3, 4, 5}));
}

}  // namespace
}  // namespace gflow
