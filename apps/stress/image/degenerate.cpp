// SPDX-License-Identifier: Apache-2.0
// T30: no Gaussian, one, none visible, all at one depth, 1e5 over one pixel, surfels and needles.
#include <cstring>

#include "apps/stress/device_maths.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/image/dense.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

struct Result {
  FloatArrays images, gradients;
  double not_finite() const {
    double count = 0;
    for (const FloatArrays* all : {&images, &gradients})
      for (const auto& [name, values] : *all) count += count_not_finite(values);
    return count;
  }
};
Result run(Queue& queue, const PosedScene& s) {
  DeviceScene device(queue, s);
  Result r;
  r.images = device.forward();
  r.gradients = device.backward(random_cotangents(s, 30));
  return r;
}

double background_off(const PosedScene& s, const FloatArrays& images) {
  double most = 0;
  for (size_t i = 0; i < 3 * s.pixels(); ++i)
    most = worse(most, std::fabs(double(images.at("rgb")[i]) - s.shot.background[i / s.pixels()]));
  return most;
}

bool same_arrays(const FloatArrays& a, const FloatArrays& b) {
  for (const auto& [name, values] : a)
    if (std::memcmp(values.data(), b.at(name).data(), values.size() * sizeof(float)) != 0)
      return false;
  return a.size() == b.size();
}

Rows degenerate(Queue& queue) {
  Rows rows;
  PosedScene none = random_scene({0, 40, 30});
  rows.push_back(
      {"no Gaussian: colour vs background", background_off(none, run(queue, none).images), 0});

  PosedScene one = none;
  add_gaussian(one, {.1, -.05, 3}, {.3, .2, .1}, .8, {.1, .05, 0});
  compare_with_dense(queue, one, "one Gaussian", rows);

  PosedScene behind = none;
  for (int i = 0; i < 100; ++i) add_gaussian(behind, {0, 0, -1. - i}, {.5, .5, .5}, .9);
  const Result culled = run(queue, behind);
  double gradients = 0;
  for (const auto& [name, values] : culled.gradients)
    for (const float x : values) gradients += x != 0;
  rows.push_back({"all culled: colour vs background", background_off(behind, culled.images), 0});
  rows.push_back({"all culled: non-zero gradients", gradients, 0});

  PosedScene ties = none;
  ties.shot.camera = ties.shot.camera_t2 = test_camera(40, 30);
  Random random(30);
  for (int i = 0; i < 10000; ++i) {
    add_gaussian(ties, {random.uniform(-1, 1), random.uniform(-.7, .7), 2}, {.05, .03, .02},
                 random.uniform(.1, .9), {.01, .02, 0});
    for (int c = 0; c < 3; ++c) ties.p["colors"][3 * i + c] = double(float(random.uniform(0, 1)));
  }
  const Result first = run(queue, ties);
  double different = 0;
  for (int i = 0; i < 100; ++i) {
    const Result again = run(queue, ties);
    different +=
        !same_arrays(again.images, first.images) || !same_arrays(again.gradients, first.gradients);
  }
  rows.push_back({"1e4 at one depth: runs of 100 that differ in bits", different, 0});
  const reference::Rendering r = reference::render(ties.shot, reference::posed(ties.p));
  rows.push_back({"1e4 at one depth: colour vs order by index",
                  largest_error(first.images.at("rgb"), r.images.rgb, r.contributors.doubtful),
                  1e-5});
  rows.push_back({"1e4 at one depth: share of pixels skipped as ambiguous",
                  share_of(r.contributors.doubtful), kMostDoubtful});

  // Flat (one scale 0), needles (two), points (three).
  for (const auto& [name, scales] : {std::pair{"surfels", real3{.3, .2, 0}},
                                     {"needles", real3{.5, 0, 0}},
                                     {"points", real3{0, 0, 0}}}) {
    PosedScene s = random_scene({60, 40, 30});
    for (const char* end : {"scales", "scales_t2"}) {
      std::vector<double>& all = s.p.at(end);
      for (size_t i = 0; i < s.count(); ++i) {
        all[3 * i] = double(float(scales.x));
        all[3 * i + 1] = double(float(scales.y));
        all[3 * i + 2] = scales.z;
      }
    }
    for (const Transport t : {Transport::paper, Transport::ot, Transport::material}) {
      s.shot.settings.transport = t;
      compare_with_dense(queue, s, fmt::format("{}, transport {}", name, mode_name(int(t))), rows);
    }
  }
  return rows;
}

Rows crowd(Queue& queue) {  // the slower part of T30
  PosedScene s = random_scene({0, 16, 16});
  s.shot.camera = s.shot.camera_t2 = test_camera(16, 16);
  Random random(31);
  for (int i = 0; i < 100000; ++i)
    add_gaussian(s, {random.uniform(-.01, .01), random.uniform(-.01, .01), random.uniform(2, 3)},
                 {.001, .001, .001}, .5);
  const Result r = run(queue, s);
  const reference::Rendering expected = reference::render(s.shot, reference::posed(s.p));
  return {
      {"1e5 on one pixel: non-finite", r.not_finite(), 0},
      {"1e5 on one pixel: transmittance", double(r.images.at("transmittance")[8 * 16 + 8]), 1e-4},
      {"1e5 on one pixel: colour",
       largest_error(r.images.at("rgb"), expected.images.rgb, expected.contributors.doubtful),
       1e-5},
      {"1e5 on one pixel: share of pixels skipped as ambiguous",
       share_of(expected.contributors.doubtful), kMostDoubtful}};
}

}  // namespace

Tests degenerate_tests() {
  return {{"T30", "degenerate scenes", true, degenerate}, {"T30", "1e5 on one pixel", true, crowd}};
}

}  // namespace gflow::stress
