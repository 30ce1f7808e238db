// SPDX-License-Identifier: Apache-2.0
// Derivatives of the losses on images.
#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/splats.hpp"
#include "apps/stress/stress.hpp"
#include "optim/loss/camera_colors.hpp"
#include "optim/loss/depth_loss.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/loss/image_loss.hpp"
#include "optim/reference/loss.hpp"

namespace gflow::stress {
namespace {

Derivative image_loss_row(Queue& queue, float ssim_weight) {
  constexpr int width = 23, height = 17;
  Random random(47);
  Floats rgb;
  std::vector<cl_uchar> truth;
  for (int i = 0; i < 3 * width * height; ++i) {
    rgb.push_back(float(random.uniform(.05, .95)));
    truth.push_back(cl_uchar(random.uniform(0, 255)));
  }
  const std::vector<double> x(rgb.begin(), rgb.end());
  const auto value = [&](const std::vector<double>& y) {
    return reference::image_loss(width, height, y, truth, double(ssim_weight));
  };
  const std::vector<double> expected = value(x).v_rgb;
  const std::vector<size_t> some = spread_indices(x.size(), 30);  // each costs four whole losses
  const std::vector<double> differences =
      slopes([&](const std::vector<double>& y) { return value(y).total; }, x, 1e-4, some);
  ImageLoss loss(queue, ssim_weight);
  Buffer<float> v(queue, rgb.size(), "v_rgb");
  loss.run(queue, width, height, Buffer<float>(queue, rgb, "rgb"),
           Buffer<cl_uchar>(queue, truth, "truth"), v);
  return {ssim_weight > 0 ? "image_loss_bwd" : "l1_bwd",
          fmt::format("rgb, SSIM weight {}", ssim_weight),
          relative_error(v.read(queue), expected),
          relative_error(picked(expected, some), differences),
          1e-4,
          1e-6};
}

Derivative flow_loss_row(Queue& queue) {
  constexpr int width = 19, height = 11;
  constexpr size_t pixels = size_t(width) * height;
  Random random(48);
  Floats flow, target_flow, alpha;
  std::vector<cl_uchar> confidence;
  for (size_t i = 0; i < 2 * pixels; ++i) {
    flow.push_back(float(3 * random.normal()));
    target_flow.push_back(float(3 * random.normal()));
  }
  std::vector<double> trust;
  for (size_t i = 0; i < pixels; ++i) {
    alpha.push_back(float(random.uniform(0, 1)));
    confidence.push_back(cl_uchar(random.uniform(0, 255)));
    trust.push_back(confidence.back() / 255.);
  }
  const std::vector<double> x(flow.begin(), flow.end());
  const auto value = [&](const std::vector<double>& y) {
    return reference::flow_loss(y, {alpha.begin(), alpha.end()},
                                {target_flow.begin(), target_flow.end()}, trust, double(.3f),
                                double(.5f));
  };
  const std::vector<double> expected = value(x).v_flow;
  FlowLoss loss(queue, .5f);
  Buffer<float> v(queue, 2 * pixels, "v_flow");
  loss.run(queue, .3f, width, height, Buffer<float>(queue, flow, "flow"),
           Buffer<float>(queue, alpha, "alpha"), Buffer<float>(queue, target_flow, "teacher"),
           Buffer<cl_uchar>(queue, confidence, "confidence"), v);
  return {
      "flow_loss",
      "flow",
      relative_error(v.read(queue), expected),
      relative_error(expected,
                     slopes([&](const std::vector<double>& y) { return value(y).loss; }, x, 1e-3)),
      1e-4,
      1e-6};
}

// Colours of a camera: by the rendered colours and by the camera's numbers, with shrinkage.
Derivative camera_color_row(Queue& queue) {
  constexpr size_t pixels = 1000, camera = 1, cameras = 3;
  constexpr float shrink = .3f;
  Random random(52);
  Floats x, v;
  for (size_t i = 0; i < 3 * pixels; ++i) x.push_back(float(random.uniform(0, 1)));
  for (size_t k = 0; k < CAMERA_COLOR_SIZE; ++k) x.push_back(float(random.uniform(-.2, .2)));
  for (size_t i = 0; i < 3 * pixels; ++i) v.push_back(float(random.normal()));
  const auto color_of = [](const std::vector<double>& y) {
    CameraColor color;
    std::copy_n(y.end() - CAMERA_COLOR_SIZE, CAMERA_COLOR_SIZE, color.v);
    return color;
  };
  const auto cost = [&](const std::vector<double>& y) {
    const CameraColor color = color_of(y);
    double sum = 0;
    for (const double number : color.v) sum += double(shrink) / 2 * number * number;
    for (size_t i = 0; i < pixels; ++i) {
      const LaneColor shown = camera_color(color, {{y[i], y[pixels + i], y[2 * pixels + i]}});
      for (size_t c = 0; c < 3; ++c) sum += double(v[c * pixels + i]) * shown.c[c];
    }
    return sum;
  };
  const std::vector<double> at(x.begin(), x.end());
  const CameraColor color = color_of(at);
  std::vector<double> expected(x.size());
  for (size_t k = 0; k < CAMERA_COLOR_SIZE; ++k)
    expected[3 * pixels + k] = double(shrink) * color.v[k];
  for (size_t i = 0; i < pixels; ++i) {
    const LaneColor v_x =
        camera_color_vjp(color, {{double(v[i]), double(v[pixels + i]), double(v[2 * pixels + i])}});
    for (size_t c = 0; c < 3; ++c) {
      const double v_c = double(v[c * pixels + i]);
      expected[c * pixels + i] = v_x.c[c];
      for (size_t k = 0; k < 3; ++k) expected[3 * pixels + 4 * c + k] += v_c * at[k * pixels + i];
      expected[3 * pixels + 4 * c + 3] += v_c;
    }
  }
  CameraColors colors(queue, cameras, {0, shrink});
  colors.colors().values.write_range(queue, CAMERA_COLOR_SIZE * camera,
                                     Floats(x.end() - CAMERA_COLOR_SIZE, x.end()));
  const Buffer<float> rgb(queue, Floats(x.begin(), x.begin() + 3 * pixels), "rgb");
  Buffer<float> v_rgb(queue, v, "v_rgb");
  colors.backward(queue, camera, pixels, rgb, v_rgb);
  Floats found = v_rgb.read(queue);
  const Floats of_camera =
      colors.colors().grads.read_range(queue, CAMERA_COLOR_SIZE * camera, CAMERA_COLOR_SIZE);
  found.insert(found.end(), of_camera.begin(), of_camera.end());
  const std::vector<size_t> some = spread_indices(x.size(), 200);
  return {"camera_color_bwd",
          "rgb camera_color",
          relative_error(found, expected),
          relative_error(picked(expected, some), slopes(cost, at, 1e-3, some)),
          1e-4,
          1e-6};
}

// By depth and alpha; the weight alpha of a pixel is a constant.
Derivative depth_loss_row(Queue& queue) {
  constexpr size_t pixels = 211;
  Random random(53);
  Floats x, target;
  for (size_t i = 0; i < pixels; ++i) x.push_back(float(random.uniform(1, 9)));
  for (size_t i = 0; i < pixels; ++i) x.push_back(float(random.uniform(.1, 1)));
  for (size_t i = 0; i < pixels; ++i)
    target.push_back(x[i] / x[pixels + i] * float(std::exp(.3 * random.normal())));
  const std::vector<double> at(x.begin(), x.end()), files(target.begin(), target.end());
  const std::vector<double> weights(at.begin() + pixels, at.end());
  const auto value = [&](const std::vector<double>& y) {
    return reference::depth_loss({y.begin(), y.begin() + pixels}, {y.begin() + pixels, y.end()},
                                 weights, files, double(.3f), double(.2f));
  };
  std::vector<double> expected = value(at).v_depth;
  for (const double v : value(at).v_alpha) expected.push_back(v);
  DepthLoss loss(queue, DepthFit::none, .2f, 1);
  const Buffer<float> depth(queue, Floats(x.begin(), x.begin() + pixels), "depth");
  const Buffer<float> alpha(queue, Floats(x.begin() + pixels, x.end()), "alpha");
  Buffer<float> v_depth(queue, Floats(pixels, 0.f), "v_depth"),
      v_alpha(queue, Floats(pixels, 0.f), "v_alpha");
  loss.run(queue, .3f, 0, pixels, depth, alpha, Buffer<float>(queue, target, "file"), v_depth,
           v_alpha);
  Floats found = v_depth.read(queue);
  for (const float v : v_alpha.read(queue)) found.push_back(v);
  return {
      "depth_loss",
      "depth alpha",
      relative_error(found, expected),
      relative_error(expected,
                     slopes([&](const std::vector<double>& y) { return value(y).loss; }, at, 1e-3)),
      1e-4,
      1e-6};
}

}  // namespace

std::vector<Derivative> loss_derivatives(Queue& queue) {
  std::vector<Derivative> rows;
  for (const float ssim : {0.f, .2f}) rows.push_back(image_loss_row(queue, ssim));
  rows.push_back(flow_loss_row(queue));
  rows.push_back(depth_loss_row(queue));
  rows.push_back(camera_color_row(queue));
  return rows;
}

}  // namespace gflow::stress
