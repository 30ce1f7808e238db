// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/exact.hpp"

#include <random>

#include "runtime/base/worse.hpp"

namespace gflow::bench {
namespace {

std::vector<double> widened(const std::vector<float>& a) { return {a.begin(), a.end()}; }

// All Gaussians in front of the camera at every pixel, nearest first.
reference::Contributors everyone(const reference::Shot& shot,
                                 const std::vector<reference::Seen>& seen) {
  std::vector<uint32_t> order;
  for (uint32_t i = 0; i < seen.size(); ++i)
    if (seen[i].drawn) order.push_back(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return seen[a].p.p.z < seen[b].p.p.z; });
  const size_t pixels = size_t(shot.camera.width) * size_t(shot.camera.height);
  reference::Contributors all;
  all.first.push_back(0);
  all.list.reserve(pixels * order.size());
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    const real2 x = reference::pixel_centre(shot, pixel);
    for (const uint32_t i : order) {
      const double raw = seen[i].opacity * std::exp(-0.5 * reference::distance2(seen[i], x));
      if (raw > 1e-12) all.list.push_back({i, raw > 0.99});  // negligible, but saves memory
    }
    all.first.push_back(all.list.size());
  }
  all.doubtful.assign(pixels, 0);
  return all;
}

std::vector<const std::vector<double>*> groups_of(const reference::Gaussians& g) {
  return {&g.means, &g.factors, &g.opacities, &g.colors, &g.means_t2, &g.factors_t2};
}

}  // namespace

Exact::Exact(Queue& queue, BenchScene& scene) {
  scene.pose(queue);
  shot_.camera = scene.view.camera;
  shot_.camera_t2 = scene.view.camera_t2;
  gaussians_ = {
      widened(scene.at_t1.means.read(queue)),     widened(scene.at_t1.factors.read(queue)),
      widened(scene.at_t1.opacities.read(queue)), widened(scene.colors.read(queue)),
      widened(scene.at_t2.means.read(queue)),     widened(scene.at_t2.factors.read(queue))};
  const std::vector<reference::Seen> seen = reference::see(shot_, gaussians_);
  doubtful_ = reference::decide(shot_, seen).doubtful;
  const size_t pixels = doubtful_.size();
  std::mt19937 rng(11);
  std::normal_distribution<double> normal;
  const auto noise = [&](size_t planes) {
    std::vector<double> v(planes * pixels);
    for (size_t i = 0; i < v.size(); ++i) {
      const double x = double(float(normal(rng)));
      v[i] = doubtful_[i % pixels] ? 0 : x;
    }
    return v;
  };
  v_ = {noise(3), noise(1), std::vector<double>(pixels), noise(2)};
  as_defined_ = truth_of(nullptr);
  const reference::Contributors all = everyone(shot_, seen);
  without_cutoffs_ = truth_of(&all);
}

Exact::Truth Exact::truth_of(const reference::Contributors* fixed) const {
  const reference::Rendering r = reference::render(shot_, gaussians_, fixed);
  return {r.images, reference::render_vjp(shot_, gaussians_, r, v_)};
}

Exact::Found Exact::compare(Queue& queue, const Images& images, const GaussianGradients& g) const {
  const std::vector<float> rgb = images.rgb.read(queue), flow = images.flow.read(queue);
  const std::vector<std::vector<float>> gradients{
      g.v_means.read(queue),  g.v_factors.read(queue),  g.v_opacities.read(queue),
      g.v_colors.read(queue), g.v_means_t2.read(queue), g.v_factors_t2.read(queue)};
  return {errors(rgb, flow, gradients, as_defined_, true),
          errors(rgb, flow, gradients, without_cutoffs_, false)};
}

Errors Exact::errors(const std::vector<float>& rgb, const std::vector<float>& flow,
                     const std::vector<std::vector<float>>& gradients, const Truth& truth,
                     bool skip_doubtful) const {
  const auto rms = [&](const std::vector<float>& got, const std::vector<double>& expected) {
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      if (skip_doubtful && doubtful_[i % doubtful_.size()]) continue;
      sum += (double(got[i]) - expected[i]) * (double(got[i]) - expected[i]);
      ++count;
    }
    return count ? std::sqrt(sum / double(count)) : 0;
  };
  Errors e;
  e.rgb = rms(rgb, truth.images.rgb);
  e.flow_px = std::sqrt(2.0) * rms(flow, truth.images.flow);  // of the vector's length
  const auto expected = groups_of(truth.gradients);
  for (size_t k = 0; k < expected.size(); ++k) {
    double difference = 0, length = 0;
    for (size_t i = 0; i < expected[k]->size(); ++i) {
      const double x = (*expected[k])[i], d = double(gradients[k][i]) - x;
      difference += d * d;
      length += x * x;
    }
    if (length > 0) e.gradients = worse(e.gradients, std::sqrt(difference / length));
  }
  return e;
}

}  // namespace gflow::bench
