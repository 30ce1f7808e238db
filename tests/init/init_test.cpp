// SPDX-License-Identifier: Apache-2.0
#include "optim/init/init.hpp"

#include <algorithm>
#include <numeric>
#include <random>

#include "optim/density/memory.hpp"
#include "optim/eval/views.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/init/dynamic_seeds.hpp"
#include "optim/train/preparation.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// Mean of the three smallest distances to other points, by brute force.
std::vector<double> by_brute_force(const std::vector<float>& xyz) {
  const size_t n = xyz.size() / 3;
  std::vector<double> result;
  for (size_t i = 0; i < n; ++i) {
    std::vector<double> distances;
    for (size_t j = 0; j < n; ++j) {
      double squared = 0;
      for (size_t k = 0; k < 3; ++k)
        squared += std::pow(double(xyz[3 * i + k]) - double(xyz[3 * j + k]), 2);
      if (j != i) distances.push_back(std::sqrt(squared));
    }
    std::sort(distances.begin(), distances.end());
    const size_t count = std::min<size_t>(3, distances.size());
    result.push_back(std::accumulate(distances.begin(), distances.begin() + long(count), 0.) /
                     double(count));
  }
  return result;
}

std::vector<float> random_points(size_t n) {
  std::mt19937 rng(1);
  std::vector<float> xyz;
  for (size_t i = 0; i < 3 * n; ++i) xyz.push_back(float(rng()) / 4294967296.f);
  return xyz;
}

// A difference of two coordinates of about 1 is rounded by 1e-7, distances are above 1e-2: 1e-5.
TEST(NeighbourDistance, IsTheMeanOfTheThreeNearest) {
  for (const size_t n : {size_t(2), size_t(3), size_t(4), size_t(500)})
    EXPECT_TRUE(all_close(neighbour_distance(random_points(n)), by_brute_force(random_points(n)),
                          {1e-5, 1e-7}))
        << n << " points";
}

TEST(NeighbourDistance, OfPointsThatCoincideIsTheSmallestThereIs) {
  std::vector<float> xyz;
  for (int i = 0; i < 4; ++i) xyz.insert(xyz.end(), {1, 1, 1});
  xyz.insert(xyz.end(), {1, 1, 3});  // 2 from its three nearest points
  for (const float d : neighbour_distance(xyz)) EXPECT_EQ(d, 2);
}

TEST(NeighbourDistance, IsNeverZero) {
  EXPECT_TRUE(neighbour_distance({}).empty());
  EXPECT_GT(neighbour_distance({1, 2, 3})[0], 0);
  for (const float d : neighbour_distance({1, 2, 3, 1, 2, 3})) EXPECT_GT(d, 0);
}

struct Loaded {
  explicit Loaded(const TrainOptions& config) : loaded(load_scene(config.scene, "")) {}
  HostModel model(const TrainOptions& config) {
    FlowStore no_flows({});
    return initial_model(loaded.scene, *loaded.frames,
                         parts_of_interest(loaded.scene, *loaded.frames, {}), {}, {}, no_flows,
                         config);
  }
  LoadedScene loaded;
};

TEST(InitialModel, StandsAtThePointsOfTheScene) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TrainOptions config = small_config(scene, 10);
  Loaded loaded(config);
  const HostModel model = loaded.model(config);
  EXPECT_EQ(model.count, scene.truth.count);
  const std::vector<double>& places = loaded.loaded.scene.points.xyz;
  EXPECT_EQ(model.groups.at("means"), std::vector<float>(places.begin(), places.end()));
  EXPECT_TRUE(is_static(model.shape, model.groups));
  EXPECT_EQ(model.groups.at("sh_rest").size(), 9 * model.count);  // degree 1
  for (const float v : model.groups.at("logit_opacities"))
    EXPECT_NEAR(1 / (1 + std::exp(-v)), config.init.opacity, 1e-6);
}

TEST(InitialModel, IsRandomWhenAskedForAndDeterministicForTheSeed) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::random;
  config.init.count = 50;
  Loaded loaded(config);
  const HostModel first = loaded.model(config);
  EXPECT_EQ(first.count, 50u);
  EXPECT_EQ(first.groups, loaded.model(config).groups);
  config.train.seed = 4;
  EXPECT_NE(first.groups, loaded.model(config).groups);
}

TEST(InitialModel, PutsRandomPointsOnTheObjectWhereImagesHaveAlpha) {
  Queue queue = test_queue();
  const SmallScene scene(queue, true);
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::visual_hull;
  config.init.count = 100;
  // The blob is between x = -0.3 and 0.3 for part of the video only: a point on it that most images
  // see is near the middle. Its Gaussians extend 0.25 + 3 sigma of 0.1 from it.
  Loaded loaded(config);
  ASSERT_TRUE(loaded.loaded.scene.has_alpha);
  const HostModel model = loaded.model(config);
  ASSERT_GT(model.count, 0u);
  const float reach = 0.25f + 0.3f + blob_path / 2;
  for (size_t i = 0; i < model.count; ++i) {
    const float* p = &model.groups.at("means")[3 * i];
    EXPECT_LT(std::hypot(p[0], p[1]), reach) << "point " << i;
  }
}

TEST(InitialModel, RandomPointsFillTheBoxEvenWhereImagesHaveAlpha) {
  Queue queue = test_queue();
  const SmallScene scene(queue, true);
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::random;
  config.init.count = 100;
  EXPECT_EQ(Loaded(config).model(config).count, 100u);
}

TEST(InitialModel, OfAVisualHullNeedsAlpha) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::visual_hull;
  Loaded loaded(config);
  expect_error([&] { loaded.model(config); }, {"visual-hull", "alpha"});
}

// A static splat of SH degree 2 with distinct values in every column.
PlyTable static_splat(size_t count) {
  SplatTable table(count, 2);
  for (size_t i = 0; i < table.table.values.size(); ++i)
    table.table.values[i] = 0.1f + 0.01f * float(i % 97);
  return table.table;
}

TEST(InitialModel, TakesTheGaussiansOfAFileAsTheyAre) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  write_ply(scene.folder().file("first.ply"), static_splat(7));
  config.init.file = scene.folder().file("first.ply");
  Loaded loaded(config);
  for (const int degree : {1, 3}) {
    config.motion.sh_degree = degree;
    for (const InitFrom from : {InitFrom::file, InitFrom::automatic}) {
      config.init.from = from;
      const HostModel model = loaded.model(config), file = read_model(config.init.file);
      ASSERT_EQ(model.count, 7u);
      for (const char* name : {"means", "quats", "logit_opacities", "sh0"})
        EXPECT_EQ(model.groups.at(name), file.groups.at(name)) << name;
      const size_t width = degree == 1 ? 9 : 45, common = degree == 1 ? 9 : 24;
      for (size_t i = 0; i < 7; ++i) {
        for (size_t k = 0; k < width; ++k)
          EXPECT_EQ(model.groups.at("sh_rest")[width * i + k],
                    k < common ? file.groups.at("sh_rest")[24 * i + k] : 0.f);
        for (size_t k = 0; k < 3; ++k)
          EXPECT_EQ(model.groups.at("log_scales")[4 * i + k],
                    file.groups.at("log_scales")[4 * i + k]);
        EXPECT_FLOAT_EQ(std::exp(model.groups.at("log_scales")[4 * i + 3]),
                        config.init.lifetime * model.shape.duration);
      }
      EXPECT_TRUE(is_static(model.shape, model.groups));
    }
  }
}

TEST(InitialModel, RefusesAFileThatCannotBeginAScene) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::file;
  Loaded loaded(config);
  expect_error([&] { loaded.model(config); }, {"init.from", "init.file is empty"});
  const std::string path = config.init.file = scene.folder().file("first.ply");
  expect_error([&] { loaded.model(config); }, {"init.file", "first.ply", "No such file"});
  write_ply(path, static_splat(7));
  config.density.cap = 6;
  expect_error([&] { loaded.model(config); }, {"first.ply", "7 Gaussians", "density.cap = 6"});
  config.density.cap = 100;
  HostModel moving = read_model(path);
  moving.groups["velocities"][4] = 1;
  write_model(path, moving);
  expect_error([&] { loaded.model(config); }, {"first.ply", "has motion", "gflow export"});
}

TEST(InitialModel, OfOneTimeStepIsStaticForEver) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.scene.max_steps = 1;
  Loaded loaded(config);
  EXPECT_TRUE(is_static_model(loaded.model(config)));
}

TEST(InitialModel, NeedsPointsWhenTheyAreAskedFor) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  std::filesystem::remove(scene.folder().file("points3D.ply"));
  TrainOptions config = small_config(scene, 10);
  config.init.from = InitFrom::points;
  Loaded loaded(config);
  expect_error([&] { loaded.model(config); }, {"init.from", "points3D.ply"});
}

// The blob moves along x by blob_path; each seed is where three cameras see a change.
TEST(InitialModel, StaysWithinTheCapAndTheMemorySeedsIncluded) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.init.dynamic = 100;
  config.density.cap = 40;
  const HostModel few = SmallTraining(queue, config).model.read(queue);
  EXPECT_EQ(few.count, 40u);
  size_t short_lived = 0;
  for (size_t i = 0; i < few.count; ++i)
    short_lived += std::exp(few.groups.at("log_scales")[4 * i + 3]) < few.shape.duration;
  EXPECT_EQ(short_lived, 20u);  // points keep half of the space
  config.density.cap = 100000;
  config.init.dynamic = 3000;
  const auto begun = [&](int memory) {
    config.density.memory = memory;  // MiB
    Preparation prepared(config, "");
    prepared.compute_flow("", true);
    prepared.find_motion_masks();
    return prepared.first_model(queue);
  };
  const HostModel free = begun(0), within = begun(1);
  const size_t holds = most_gaussians(queue.info, Model(queue, free).parameters, 1, false);
  ASSERT_GT(free.count, holds);
  EXPECT_LE(within.count, holds);
  EXPECT_GT(within.count, holds / 2);
}

TEST(InitialModel, SeedsWhatMovesWithItsVelocity) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 10);
  config.init.dynamic = 100;
  const SmallTraining training(queue, config);
  const HostModel model = training.model.read(queue);
  ASSERT_GT(model.count, scene.truth.count + 20);
  const auto& g = model.groups;
  size_t moving = 0;
  for (size_t i = scene.truth.count; i < model.count; ++i) {
    EXPECT_LT(std::exp(g.at("log_scales")[4 * i + 3]), model.shape.duration);  // short lives
    EXPECT_GE(g.at("means_t")[i], 0);
    EXPECT_LE(g.at("means_t")[i], model.shape.duration);
    moving += g.at("velocities")[3 * i] > 0.02f;  // towards +x, as small_scene.hpp explains
    EXPECT_GT(g.at("velocities")[3 * i], -0.4f);
  }
  EXPECT_GT(moving, (model.count - scene.truth.count) / 4);
}

// A few points of a far background must not hide the motion.
TEST(InitialModel, SeedsWhatMovesWhateverElseThePointsContain) {
  Queue queue = test_queue();
  const SmallScene small(queue);
  TrainOptions config = small_config(small, 10);
  config.init.dynamic = 100;
  LoadedScene loaded = load_scene(config.scene, "");
  Scene& scene = loaded.scene;
  FlowStore no_flow(std::vector<FlowStore::Loader>{});
  const std::vector<StaticCamera> cameras = static_cameras_of(scene, *loaded.frames);
  const auto found = [&] {
    return dynamic_seeds(scene, *loaded.frames, cameras, {}, no_flow, config);
  };
  const Seeds near = found();
  ASSERT_GE(near.size(), 50u);
  const size_t count = scene.points.size();
  for (size_t i = 0; i < count / 10 + 6; ++i) {
    const double side = i % 2 ? 400 : -400;
    scene.points.xyz.insert(scene.points.xyz.end(), {side, -side, side * double(i % 3)});
    scene.points.rgb.insert(scene.points.rgb.end(), {9, 9, 9});
  }
  const Seeds far = found();
  EXPECT_GE(far.size(), near.size() / 2);
  const auto mean_x = [](const Seeds& seeds) {
    double sum = 0;
    for (size_t i = 0; i < seeds.size(); ++i) sum += double(seeds.xyz[3 * i]);
    return sum / double(seeds.size());
  };
  EXPECT_NEAR(mean_x(far), mean_x(near), 0.1);  // the same blob
}

// A static Gaussian with set_velocity(v) moves by v from t to t + 1.
class EveryMotionModel : public testing::TestWithParam<MotionModelKind> {};

TEST_P(EveryMotionModel, IsGivenAVelocityOnTheHostAndMovesByItOnTheDevice) {
  Queue queue = test_queue();
  for (const std::array<double, 3> v :
       {std::array<double, 3>{0, 0, 0}, {0.3, 0, 0}, {-0.2, 0.5, 0.1}, {0, 0, -2}}) {
    HostModel host;
    append_gaussian(host, {0, 0, 0}, 0.05f, {0.5f, 0.5f, 0.5f}, 0);
    host.shape.motion = GetParam();
    host.shape.hexplane.times = 2;
    host.shape.duration = 2;
    host.shape.keys = 5;
    host.shape.sh_degree = 0;
    host.groups["log_scales"][3] = std::log(0.4f);
    set_static(host.shape, host.groups, 1);
    EXPECT_TRUE(is_static(host.shape, host.groups));
    set_velocity(host.shape, host.groups, 0, v, 0.05, 0.4);
    EXPECT_EQ(is_static(host.shape, host.groups), v == (std::array<double, 3>{0, 0, 0}));
    Model model(queue, host);
    GaussiansAt now, later;
    const Buffer<cl_uint> seen(queue, std::vector<cl_uint>{1}, "seen");
    model.motion->at(queue, model.parameters, 0.5f, &seen, now);
    model.motion->at(queue, model.parameters, 1.5f, &seen, later);
    const std::vector<float> a = now.means.read(queue), b = later.means.read(queue);
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(b[k] - a[k], v[k], 1e-5);  // float32
  }
}
INSTANTIATE_TEST_SUITE_P(All, EveryMotionModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace gflow
