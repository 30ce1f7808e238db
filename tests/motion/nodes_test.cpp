// SPDX-License-Identifier: Apache-2.0
// Nodes: the device against plain loops in double and their differences.
#include "optim/motion/nodes.hpp"

#include <gtest/gtest.h>

#include "optim/motion/motion_options.hpp"
#include "optim/motion/node_places.hpp"
#include "optim/reference/nodes.hpp"
#include "tests/support/device.hpp"
#include "tests/support/motion_check.hpp"

namespace gflow {
namespace {

struct NodesCase {
  int count, layers, lanes;  // lanes 0: the device's own; 1: as on a GPU
  float rigidity = 0;
};

MotionShape small_shape(const NodesCase& of) {
  MotionOptions options;
  OwnNumbers& own = options.own_of(nodes_model());
  OwnNumbers::fields(own, [&](const std::string& key, auto& value, const Help&, const Allowed&) {
    using Value = std::decay_t<decltype(value)>;
    value = key == "count" ? Value(of.count) : Value(of.rigidity);
  });
  HexplaneOptions& field = options.hexplane;
  field.levels = 1;
  field.layers = of.layers;
  field.times = 5;
  field.resolution = 2;
  field.hidden = 32;
  MotionShape shape = motion_shape(MotionModelKind::nodes, options, 3);
  shape.duration = 2;
  shape.hexplane.time_spline = 1;
  shape.hexplane.centre = {0.1f, -0.2f, 0.f};
  shape.hexplane.half_size = {1.f, 1.5f, 0.75f};
  return shape;
}

// Planes away from 0, because features are products of six.
void spread_planes(Queue& queue, MotionCheck& check) {
  std::vector<double>& planes = check.values().at("planes");
  for (double& x : planes) x = double(float(1 + 0.4 * x));
  check.parameters()["planes"].values.write(queue, to_float(planes));
}

class NodesOfSomeShapes : public testing::TestWithParam<NodesCase> {};
INSTANTIATE_TEST_SUITE_P(Motion, NodesOfSomeShapes,
                         testing::Values(NodesCase{8, 2, 0}, NodesCase{21, 1, 0},
                                         NodesCase{40, 2, 0}, NodesCase{19, 2, 1},
                                         NodesCase{35, 2, 4}));

TEST_P(NodesOfSomeShapes, TheDeviceShowsAndDifferentiatesAsTheDoubleFormulas) {
  Queue queue = test_queue(GetParam().lanes);
  const MotionShape shape = small_shape(GetParam());
  MotionCheck check(queue, shape, 13, reference::forward_of(shape), {{"network", 0.15}});
  spread_planes(queue, check);
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0}) check.expect_same_gaussians(t, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5);  // float32
}

TEST_P(NodesOfSomeShapes, MoveOnlyWhatFollowsThem) {
  Queue queue = test_queue(GetParam().lanes);
  const MotionShape shape = small_shape(GetParam());
  MotionCheck check(queue, shape, 13, reference::forward_of(shape), {{"network", 0.15}}, 0.5, 6);
  spread_planes(queue, check);
  for (const double t : {0.3, 1.7}) check.expect_same_gaussians(t, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5);  // float32
}

TEST(Nodes, AreNotAskedWhereNothingMoves) {
  Queue queue = test_queue();
  const MotionShape shape = small_shape({8, 1, 0});
  MotionCheck check(queue, shape, 5, reference::forward_of(shape), {{"network", 0.15}}, 0.5, 0);
  check.expect_same_gaussians(0.3, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5,
                              {"node_places", "node_log_radii", "planes", "network"});
}

// More than one vector of boxes, boxes that overlap, a last group that is not full, and Gaussians
// whose nodes change: the search starts from those of the last time.
TEST(Nodes, FollowTheNearestOfManyAsTheyMove) {
  for (const int lanes : {0, 1, 4}) {
    Queue queue = test_queue(lanes);
    const MotionShape shape = small_shape({531, 1, lanes});
    MotionCheck check(queue, shape, 40, reference::forward_of(shape), {{"network", 0.15}});
    spread_planes(queue, check);
    Random random(11);
    for (int round = 0; round < 3; ++round) {
      check.expect_same_gaussians(0.3, {1e-5, 1e-5});
      for (double& x : check.values().at("means")) x = double(float(x + 0.3 * random()));
      check.parameters()["means"].values.write(queue, to_float(check.values().at("means")));
    }
  }
}

// Gradients of the outputs of the network by the rigidity alone, since no Gaussian is seen.
TEST(Nodes, RigidityHasTheGradientOfCentralDifferences) {
  Queue queue = test_queue();
  const MotionShape shape = small_shape({20, 1, 0, 0.7f});
  MotionCheck check(queue, shape, 2, reference::forward_of(shape), {{"network", 0.15}});
  spread_planes(queue, check);
  Parameters& p = check.parameters();
  const Buffer<cl_uint> none(queue, std::vector<cl_uint>(2, 0u), "touched");
  const Buffer<float> zero(queue, std::vector<float>(18, 0.f), "zero");
  GaussiansAt at;
  check.motion().at(queue, p, 0.6f, nullptr, at);
  check.motion().backward(queue, p, 0.6f, true, none, zero, zero, zero);
  const Named values = check.values();
  const auto expected = numeric_gradient(
      [&](const std::vector<double>& x) {
        Named q = values;
        q["network"] = x;
        return double(0.7f) * reference::node_rigidity(shape, q, double(0.6f));
      },
      values.at("network"), 1e-6);
  EXPECT_GT(norm(expected), 0);
  EXPECT_LT(relative_l2(p["network"].grads.read(queue), expected), 1e-5);
}

TEST(Nodes, RigidMotionOfAllHasNoStrain) {
  const MotionShape shape = small_shape({12, 1, 0});
  HostGroups groups;
  groups["means"] = {};
  Random random(3);
  for (int k = 0; k < 60; ++k) groups["means"].push_back(float(random()));
  groups["node_places"].resize(36), groups["node_log_radii"].resize(12);
  set_static(shape, groups, 20, 5);
  place_nodes(shape, groups, 0, 20);
  Named p;
  for (const auto& [name, values] : groups)
    p[name] = std::vector<double>(values.begin(), values.end());
  EXPECT_EQ(reference::node_rigidity(shape, p, 0.3), 0);
  p["network"].end()[-NETWORK_OUTPUTS + 1] = 0.4;  // the bias of y
  EXPECT_LT(reference::node_rigidity(shape, p, 0.3), 1e-24);
  for (int neuron = 2; neuron < 12; ++neuron)  // by place
    p["network"].end()[-neuron * NETWORK_OUTPUTS + 1] = 0.4;
  EXPECT_GT(reference::node_rigidity(shape, p, 0.3), 1e-6);
}

TEST(Nodes, StartFarApartAndStatic) {
  const MotionShape shape = small_shape({8, 1, 0});
  HostGroups groups;
  for (int k = 0; k < 100; ++k)
    for (const float x : {0.01f * float(k), 0.f, 0.f}) groups["means"].push_back(x);
  groups["node_places"].resize(24), groups["node_log_radii"].resize(8);
  set_static(shape, groups, 100, 7);
  place_nodes(shape, groups, 0, 100);
  EXPECT_TRUE(is_static(shape, groups));
  std::vector<float> x;
  for (size_t k = 0; k < 8; ++k) x.push_back(groups["node_places"][3 * k]);
  std::sort(x.begin(), x.end());
  for (size_t k = 1; k < 8; ++k) EXPECT_GT(x[k] - x[k - 1], 0.1f);
  for (const float r : groups["node_log_radii"]) EXPECT_NEAR(r, std::log(0.25f), 0.5f);
  groups["network"].back() = 1;
  EXPECT_FALSE(is_static(shape, groups));
}

// A crowd of Gaussians at one node of four, and two at each of two others; the fourth carries none.
TEST(Nodes, IdleOnesRelieveThoseThatCarryMost) {
  NodePlaces nodes{{0, 0, 0, 1, 0, 0, 2, 0, 0, 9, 9, 9, 8, 9, 9}, std::vector<float>(5, -2.f)};
  std::vector<float> means{1, 0, 0, 1, 0.1f, 0, 2, 0, 0, 2, 0.1f, 0};
  for (int k = 0; k < 40; ++k)
    for (const float x : {0.f, 0.f, 0.01f * float(k)}) means.push_back(x);
  const std::vector<size_t> from = relieve_nodes(means, nodes);
  EXPECT_EQ(from, (std::vector<size_t>{0, 1, 2, 0, 0}));
  EXPECT_NEAR(nodes.places[11], 0.195, 1e-6);  // half way to the farthest
  EXPECT_GT(nodes.places[14], 0.25);           // half way from there
  EXPECT_EQ(nodes.places[3], 1.f);             // the others stay
  EXPECT_EQ(nodes.places[6], 2.f);
  const NodePlaces before = nodes;
  relieve_nodes(means, nodes);  // no more idle ones
  EXPECT_EQ(nodes.places, before.places);
}

TEST(Nodes, BrokenGaussiansDrawNone) {
  NodePlaces nodes{{0, 0, 0, 1, 0, 0, 2, 0, 0, 9, 9, 9, 8, 9, 9}, std::vector<float>(5, -2.f)};
  std::vector<float> means{1, 0, 0, 1, 0.1f, 0, 2, 0, 0, 2, 0.1f, 0};
  for (int k = 0; k < 40; ++k) means.insert(means.end(), {0, 0, 0.01f * float(k)});
  for (int k = 0; k < 40; ++k) means.insert(means.end(), {NAN, 0, INFINITY});
  EXPECT_EQ(relieve_nodes(means, nodes), (std::vector<size_t>{0, 1, 2, 0, 0}));
  for (const float x : nodes.places) EXPECT_TRUE(std::isfinite(x));
}

TEST(Nodes, OneIsEnoughForManyGaussiansAtOnePlace) {
  NodePlaces nodes{{0, 0, 0, 1, 0, 0, 2, 0, 0, 8, 9, 9, 9, 9, 9}, std::vector<float>(5, -2.f)};
  const NodePlaces before = nodes;
  relieve_nodes(std::vector<float>(120, 0.f), nodes);
  EXPECT_EQ(nodes.places, before.places);
}

// Many in random places: rows are sorted by place, and each moment follows its row.
TEST(Nodes, MomentsGoWithThem) {
  Queue queue = test_queue();
  const size_t count = 50;
  MotionCheck check(queue, small_shape({int(count), 1, 0}), 300, {});
  Parameters& p = check.parameters();
  const std::vector<float> old = p["node_places"].values.read(queue);
  p["node_places"].exp_avg_sq.write(queue, old);  // so that it tells the row
  check.motion().rearrange(queue, p);
  const std::vector<float> now = p["node_places"].values.read(queue);
  const std::vector<float> moments = p["node_places"].exp_avg_sq.read(queue);
  EXPECT_NE(now, old);
  size_t stayed = 0;
  for (size_t k = 0; k < count; ++k)
    stayed += std::equal(&now[3 * k], &now[3 * k + 3], &moments[3 * k]);
  EXPECT_GE(stayed, count / 2);
  for (size_t k = 0; k < count; ++k) {  // all moments are those of some old row
    bool found = false;
    for (size_t j = 0; j < count && !found; ++j)
      found = std::equal(&old[3 * j], &old[3 * j + 3], &moments[3 * k]);
    EXPECT_TRUE(found) << k;
  }
}

// Chunks in which no Gaussian, one or all are seen, and more than one of each.
TEST(Nodes, GradientsOfManyGaussiansAreTheSumOfThoseOfFew) {
  Queue queue = test_queue();
  const MotionShape shape = small_shape({100, 2, 0});
  const size_t n = 1500;
  MotionCheck check(queue, shape, n, reference::forward_of(shape), {{"network", 0.15}});
  spread_planes(queue, check);
  Parameters& p = check.parameters();
  std::vector<float> v(9 * n);
  Random random(5);
  for (float& x : v) x = float(random());
  const Buffer<float> v_all(queue, v, "v");
  GaussiansAt at;
  check.motion().at(queue, p, 0.7f, nullptr, at);
  const auto gradients = [&](const std::vector<cl_uint>& touched) {
    p.forget_seen(queue);
    check.motion().backward(queue, p, 0.7f, true, Buffer<cl_uint>(queue, touched, "touched"), v_all,
                            v_all, v_all);
    std::vector<float> all;
    for (const char* name : {"planes", "network", "node_places", "node_log_radii"})
      for (const float x : p[name].grads.read(queue)) all.push_back(x);
    return all;
  };
  std::vector<cl_uint> all(n), odd(n), even(n);
  for (size_t i = 0; i < n; ++i) {
    all[i] = i > 400 && i != 900;
    (i % 2 ? odd : even)[i] = all[i];
  }
  const auto whole = gradients(all), again = gradients(all);
  EXPECT_EQ(whole, again);  // bitwise repeatable
  const auto first = gradients(odd), second = gradients(even);
  std::vector<double> sum;
  for (size_t k = 0; k < whole.size(); ++k) sum.push_back(double(first[k]) + double(second[k]));
  EXPECT_LT(relative_l2(whole, sum), 1e-5);
}

}  // namespace
}  // namespace gflow
