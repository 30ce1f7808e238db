// SPDX-License-Identifier: Apache-2.0
#include "apps/python/rasterization.hpp"

#include <algorithm>
#include <cmath>

#include "optim/engine/splat_inputs.hpp"
#include "shared/constants.h"

namespace gflow::python {
namespace {

const InputSource kSource{"rasterization", "argument"};

// One of the arguments of a batch, as errors name it: viewmats[2].
std::string element(const char* key, size_t index) { return fmt::format("{}[{}]", key, index); }

// The input's backgrounds, or black.
std::vector<std::array<float, 3>> backgrounds_of(const RasterizationInput& input) {
  std::vector<std::array<float, 3>> backgrounds(input.cameras);
  if (input.backgrounds)
    for (size_t c = 0; c < input.cameras; ++c)
      std::copy_n(input.backgrounds + 3 * c, 3, backgrounds[c].begin());
  return backgrounds;
}

void write_from(Queue& queue, Buffer<float>& buffer, const float* data, size_t size) {
  buffer.ensure(queue, size);
  buffer.write_from(queue, data);
}

}  // namespace

Rasterization::Rasterization(Device& device, const RasterizationInput& input)
    : device_(device), input_(input), backgrounds_(backgrounds_of(input)), g_(device.gaussians()) {
  try {
    check();
  } catch (const Error& error) {
    throw InputError(error.what());
  }
  const std::lock_guard<std::mutex> lock(device_.mutex);
  upload();
}

void Rasterization::check() {
  const RasterizationInput& in = input_;
  const size_t n = in.gaussians;
  require_image_size(in.width, in.height, "width, height", kSource);
  require_room_for_images(device_.queue.info, in.pixels(), in.flow, in.gradients, "width, height",
                          kSource);
  if (!(in.near_plane >= 0 && std::isfinite(in.near_plane)))
    throw Error(fmt::format("{} is {}, expected a distance of at least 0",
                            kSource.input("near_plane"), in.near_plane));
  if (in.settings.top_k < 0)
    throw Error(fmt::format("{} is {}, expected a number of Gaussians, or 0 for all",
                            kSource.input("top_k"), in.settings.top_k));
  require_opacities({in.opacities, n}, n, "opacities", kSource);
  require_scales({in.scales, 3 * n}, n, "scales", kSource);
  if (in.flow) require_scales({in.scales_t2, 3 * n}, n, "scales_t2", kSource);
  if (in.backgrounds) require_finite({in.backgrounds, 3 * in.cameras}, "backgrounds", kSource);
  for (size_t c = 0; c < in.cameras; ++c) {
    const auto camera = [&](const char* key, const float* viewmats) {
      return camera_of({viewmats + 16 * c, 16}, element(key, c), {in.Ks + 9 * c, 9},
                       element("Ks", c), in.width, in.height, in.near_plane, kSource);
    };
    View view{};
    view.camera = camera("viewmats", in.viewmats);
    view.camera_t2 = in.flow ? camera("viewmats_t2", in.viewmats_t2) : view.camera;
    views_.push_back(view);
  }

  std::vector<char> broken(n);
  const size_t color_sets = in.colors_per_camera ? in.cameras : 1;
  const size_t color_size = 3 * n * in.coefficients;
  for (size_t set = 0; set < color_sets; ++set)
    mark_broken({in.colors + set * color_size, color_size}, broken);
  mark_broken({in.means, 3 * n}, broken);
  mark_broken({in.quats, 4 * n}, broken);
  mark_broken({in.scales, 3 * n}, broken);
  mark_broken({in.opacities, n}, broken);
  if (in.flow) {
    mark_broken({in.means_t2, 3 * n}, broken);
    mark_broken({in.quats_t2, 4 * n}, broken);
    mark_broken({in.scales_t2, 3 * n}, broken);
  }
  broken_ = broken_rows(broken);
}

void Rasterization::upload() {
  Queue& queue = device_.queue;
  RasterizationInput& in = input_;
  const size_t n = in.gaussians;
  write_from(queue, g_->t1.means, in.means, 3 * n);
  write_from(queue, g_->t1.opacities, in.opacities, n);
  write_from(queue, g_->quats, in.quats, 4 * n);
  write_from(queue, g_->scales, in.scales, 3 * n);
  device_.posed.forward(queue, g_->quats, g_->scales, g_->t1.factors);
  if (in.flow) {
    write_from(queue, g_->t2.means, in.means_t2, 3 * n);
    write_from(queue, g_->quats_t2, in.quats_t2, 4 * n);
    write_from(queue, g_->scales_t2, in.scales_t2, 3 * n);
    device_.posed.forward(queue, g_->quats_t2, g_->scales_t2, g_->t2.factors);
  }
  const size_t color_sets = in.colors_per_camera ? in.cameras : 1;
  for (size_t set = 0; set < color_sets; ++set)
    colors_.push_back(upload_colors(in.colors + set * 3 * n * in.coefficients));
}

Rasterization::Colors Rasterization::upload_colors(const float* colors) {
  Queue& queue = device_.queue;
  const size_t n = input_.gaussians;
  Colors result;
  if (input_.sh_degree < 0) {
    write_from(queue, result.shown, colors, 3 * n);
    return result;
  }
  const size_t stride = 3 * input_.coefficients;
  result.harmonics =
      std::make_unique<Parameters>(queue, n, color_groups(input_.sh_degree),
                                   std::vector<TableSpec>{}, Parameters::all, input_.gradients);
  Parameters& p = *result.harmonics;
  const size_t rest = p["sh_rest"].width;
  std::vector<float> first(3 * n), others(rest * n);
  for (size_t i = 0; i < n; ++i) {
    std::copy_n(colors + i * stride, 3, first.begin() + ptrdiff_t(3 * i));
    std::copy_n(colors + i * stride + 3, rest, others.begin() + ptrdiff_t(rest * i));
  }
  p["sh0"].values.write(queue, first);
  p["sh_rest"].values.write(queue, others);
  return result;
}

void Rasterization::forward(const RasterizationOutput& output,
                            const std::function<void()>& between) {
  Queue& queue = device_.queue;
  const Channels channels{input_.flow, input_.depth};
  engines_.clear();
  for (size_t c = 0; c < input_.cameras; ++c) {
    {
      const std::lock_guard<std::mutex> lock(device_.mutex);
      engines_.push_back(device_.engine(input_.settings));
      Engine& engine = *engines_.back();
      engine.project(queue, views_[c], channels, g_->t1);
      Colors& colors = colors_of(c);
      if (colors.harmonics)
        device_.color(input_.sh_degree)
            .forward(queue, *colors.harmonics, bands(), views_[c].camera, g_->t1,
                     engine.splats().tiles_touched, colors.shown);
      engine.draw(queue, backgrounds_[c], g_->t1, second(), colors.shown);
      read_images(c, output);
      read_geometry(c, output);
    }
    if (!input_.gradients) engines_.back().reset();
    between();
  }
}

void Rasterization::read_images(size_t camera, const RasterizationOutput& output) {
  Queue& queue = device_.queue;
  const Images& images = engines_[camera]->images();
  const size_t pixels = input_.pixels(), channels = input_.channels();
  const float* rgb = device_.read(images.rgb);
  float* colors = output.colors + camera * pixels * channels;
  float* alphas = output.alphas + camera * pixels;
  images.alpha.read_to(queue, alphas);
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < 3; ++c) colors[i * channels + c] = rgb[c * pixels + i];
  if (input_.depth) {
    const float* depth = device_.read(images.depth);
    for (size_t i = 0; i < pixels; ++i)
      colors[i * channels + 3] =
          input_.expected_depth ? depth[i] / std::max(alphas[i], kLeastAlpha) : depth[i];
  }
  if (input_.flow) {
    const float* planes = device_.read(images.flow);
    float* flow = output.flow + camera * pixels * 2;
    for (size_t i = 0; i < pixels; ++i) {
      flow[2 * i] = planes[i];
      flow[2 * i + 1] = planes[pixels + i];
    }
  }
}

// From the packed splats (kernels/shared/pixel.h).
void Rasterization::read_geometry(size_t camera, const RasterizationOutput& output) {
  if (!output.means2d) return;
  Queue& queue = device_.queue;
  const Splats& splats = engines_[camera]->splats();
  const size_t n = input_.gaussians;
  const float* records = device_.read(splats.records);
  const std::vector<cl_uint> touched = splats.tiles_touched.read(queue);
  for (size_t i = 0; i < n; ++i) {
    const size_t row = camera * n + i;
    const float* s = records + SPLAT_FLOATS * i;
    const bool visible = touched[i] > 0 && std::isfinite(s[5]);  // not with a non-finite colour
    const float k1 = visible ? s[2] / SQRT_HALF_LOG2_E : 0;
    const float k2 = visible ? s[3] / SQRT_HALF_LOG2_E : 0;
    const float k3 = visible ? s[4] / SQRT_HALF_LOG2_E : 0;
    const float a = k1 * k1, b = k1 * k2, c = k2 * k2 + k3 * k3;
    output.means2d[2 * row] = visible ? s[0] : 0;
    output.means2d[2 * row + 1] = visible ? s[1] : 0;
    output.depths[row] = visible ? s[6] : 0;
    output.conics[3 * row] = a;
    output.conics[3 * row + 1] = b;
    output.conics[3 * row + 2] = c;
    // The variances are c / det and a / det, with det = (k1 k3)^2.
    const float reach = visible ? std::max(0.f, s[5] - ALPHA_MIN_LOG2) / HALF_LOG2_E : 0;
    const auto half = [&](float part) {
      return visible ? int32_t(std::min(std::ceil(std::sqrt(reach * part) / (k1 * k3)), 1e9f)) : 0;
    };
    output.radii[2 * row] = half(c);
    output.radii[2 * row + 1] = half(a);
    output.tiles[row] = visible ? int32_t(touched[i]) : 0;
  }
}

}  // namespace gflow::python
