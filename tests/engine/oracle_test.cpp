// SPDX-License-Identifier: Apache-2.0
// The engine against scenes rendered and differentiated by an independent program in float64 (dense
// PyTorch, autograd), from file to file as by `gflow splat`, for every lane width. Two cases are in
// tests/data/oracle; more are used if the project's shared folder exists.
#include <gtest/gtest.h>

#include <filesystem>

#include "optim/engine/splat_file.hpp"
#include "optim/reference/device_scene.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

// A case's file and the options in its name.
struct OracleCase {
  std::string path, name;
  SplatOptions options;
  bool needles;  // splats of 1000 : 1
};

std::vector<OracleCase> cases() {
  std::vector<OracleCase> found;
  const auto add = [&](const std::string& folder, const std::string& name) {
    const std::string path = GFLOW_SOURCE_DIR + folder + name + ".npz";
    if (!std::filesystem::exists(path)) return;
    OracleCase c{path, name, {}, name.find("needles") == 0};
    std::string transport = name.substr(name.find('_') + 1);
    if (transport.find("_exclude") != std::string::npos) {
      c.options.settings.stop = StopRule::exclude;
      transport = transport.substr(0, transport.find('_'));
    }
    c.options.settings.transport = value_named<Transport>(transport);
    found.push_back(c);
  };
  for (const char* name : {"small_paper", "small_material"}) add("/tests/data/oracle/", name);
  for (const char* name : {"small_paper_exclude", "small_ot", "small_translate", "medium_paper",
                           "medium_material", "needles_paper", "needles_material"})
    add("/../shared/oracle/", name);
  return found;
}

double largest_error_of(const Array& actual, const Array& expected, const Array& mask) {
  const std::vector<float> a = actual.as_float();
  const std::vector<double> e = expected.as_double();
  const std::vector<int32_t> used = mask.as_int();
  const size_t channels = e.size() / used.size();
  double worst = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    const double error = std::fabs(double(a[i]) - e[i]);
    if (used[i / channels] && !(error <= worst)) worst = error;
  }
  return worst;
}

// Bounds of the engine: images 5e-6 of their range, flow in px; gradients relative L2, larger for
// transports with square roots and for needles, which are conditioned worse.
void expect_case(const OracleCase& c, int lanes) {
  SCOPED_TRACE(c.name + ", lanes " + std::to_string(lanes));
  Queue queue = test_queue(lanes);
  const Arrays input = read_npz(c.path);
  const Arrays output = splat_arrays(queue, input, c.options, c.path);
  const Array& mask = input.at("mask");
  const auto error = [&](const char* image) {
    return largest_error_of(output.at(image), input.at(image), mask);
  };
  EXPECT_LE(error("rgb"), 5e-6);
  EXPECT_LE(error("alpha"), 5e-6);
  EXPECT_LE(error("depth"), 5e-6 * largest(input.at("depth").as_double()));
  EXPECT_LE(error("flow"), c.needles ? 1e-3 : 1e-4);
  const Transport transport = c.options.settings.transport;
  const bool roots = transport == Transport::paper || transport == Transport::ot;
  size_t compared = 0;
  for (const auto& [key, expected] : input) {
    if (key.rfind("g_", 0) != 0) continue;
    const bool flow = key.rfind("g_flow_", 0) == 0;
    const double bound = c.needles ? 1e-4 : roots && flow ? 2e-5 : 1e-5;
    ASSERT_TRUE(output.count(key)) << key;
    EXPECT_LE(relative_l2(output.at(key).as_float(), expected.as_double()), bound) << key;
    ++compared;
  }
  // 5 parameters times 4 losses, and for flow the parameters at t2; `translate` has only the means
  // there.
  EXPECT_EQ(compared, transport == Transport::translate ? 21u : 23u);
}

TEST(Oracle, AgreesForEveryLaneWidth) {
  for (const OracleCase& c : cases()) {
    expect_case(c, 16);
    if (c.options.settings.stop == StopRule::exclude) continue;  // splat_test covers these programs
    for (int lanes : {8, 4, 1}) expect_case(c, lanes);
  }
}

// Checks the reference of the other tests by the same criteria.
TEST(Oracle, AgreesWithTheDoubleReference) {
  const std::string path = GFLOW_SOURCE_DIR "/tests/data/oracle/small_paper.npz";
  const Arrays input = read_npz(path);
  reference::Shot shot;
  const auto camera = [&](const char* viewmat) {
    const std::vector<float> m = input.at(viewmat).as_float(), k = input.at("K").as_float();
    const std::vector<int32_t> size = input.at("size").as_int();
    PinholeCamera c = test_camera(size[0], size[1]);
    for (int row = 0; row < 3; ++row) {
      for (int col = 0; col < 3; ++col) c.rotation[3 * row + col] = m[4 * row + col];
      c.translation[row] = m[4 * row + 3];
    }
    c.fx = k[0], c.fy = k[4], c.cx = k[2], c.cy = k[5];
    return c;
  };
  shot.camera = camera("viewmat");
  shot.camera_t2 = camera("viewmat_t2");
  shot.settings.transport = Transport::paper;
  for (int i = 0; i < 3; ++i) shot.background[i] = input.at("background").as_double()[i];
  reference::Named p;
  for (const char* name :
       {"means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2"})
    p[name] = input.at(name).as_double();
  const reference::Gaussians g = reference::posed(p);
  const reference::Rendering r = reference::render(shot, g);
  // Its constants are float32 (0.3f and the field margin): 1e-8 relative.
  EXPECT_LE(largest_error_of({input.at("alpha").shape, r.images.alpha}, input.at("alpha"),
                             input.at("mask")),
            1e-6);
  const size_t pixels = r.images.alpha.size();
  reference::Planes v{std::vector<double>(3 * pixels), std::vector<double>(pixels),
                      std::vector<double>(pixels), std::vector<double>(2 * pixels)};
  const std::vector<double> v_flow = input.at("v_flow").as_double();
  for (size_t i = 0; i < 2 * pixels; ++i) v.flow[i % 2 * pixels + i / 2] = v_flow[i];
  for (const auto& [name, values] : reference::posed_vjp(p, reference::render_vjp(shot, g, r, v)))
    EXPECT_LE(relative_l2(values, input.at("g_flow_" + name).as_double()), 1e-6) << name;
}

}  // namespace
}  // namespace gflow
