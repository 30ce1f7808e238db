// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/splat_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/engine/posed.hpp"
#include "optim/engine/splat_inputs.hpp"

namespace gflow {
namespace {

using Shape = std::vector<size_t>;

[[noreturn]] void refuse_shape(const Array& array, const std::string& key, const std::string& name,
                               const std::string& expected) {
  throw Error(fmt::format("reading {}: array '{}' has shape {}, expected {}", name, key,
                          array.shape_text(), expected));
}

// An array as floats. Error for another shape.
std::vector<float> floats(const Arrays& input, const std::string& key, const Shape& shape,
                          const std::string& name) {
  const Array& array = array_named(input, key, name);
  if (array.shape != shape) refuse_shape(array, key, name, Array{shape, {}}.shape_text());
  return array.as_float();
}

std::vector<float> floats_or(const Arrays& input, const std::string& key, const Shape& shape,
                             const std::string& name, const std::vector<float>& otherwise) {
  return input.count(key) ? floats(input, key, shape, name) : otherwise;
}

// [H, W, C] to planes [C, H, W].
std::vector<float> to_planes(const std::vector<float>& image, size_t channels) {
  const size_t pixels = image.size() / channels;
  std::vector<float> planes(image.size());
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < channels; ++c) planes[c * pixels + i] = image[i * channels + c];
  return planes;
}
std::vector<float> from_planes(const std::vector<float>& planes, size_t channels) {
  const size_t pixels = planes.size() / channels;
  std::vector<float> image(planes.size());
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < channels; ++c) image[i * channels + c] = planes[c * pixels + i];
  return image;
}

// Indices of Gaussians with a non-finite value in any array.
std::vector<int32_t> broken_gaussians(const Arrays& input, size_t n) {
  std::vector<char> broken(n);
  for (const char* key :
       {"means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2"})
    if (input.count(key)) mark_broken(input.at(key).as_float(), broken);
  return broken_rows(broken);
}

InputSource source_of(const std::string& name) { return {"reading " + name, "array"}; }

// An output image: its name, channels and cotangent.
struct Loss {
  std::string key;
  size_t channels;
  Buffer<float> ImageGradients::*gradient;
};

}  // namespace

const std::set<std::string> splat_arrays_known{
    "means",      "quats", "scales",     "opacities", "colors",   "viewmat",
    "K",          "size",  "background", "means_t2",  "quats_t2", "scales_t2",
    "viewmat_t2", "v_rgb", "v_alpha",    "v_depth",   "v_flow"};

SplatScene splat_scene(Queue& queue, const Arrays& input, float near_plane,
                       const std::string& name) {
  const Array& size = array_named(input, "size", name);
  if (size.size() != 2)
    throw Error("reading " + name + ": array 'size' should hold width and height, its shape is " +
                size.shape_text());
  const InputSource source = source_of(name);
  const std::vector<double> sides = size.as_double();
  require_image_size(sides[0], sides[1], "size", source);
  const int width = int(sides[0]), height = int(sides[1]);
  const bool backward = std::any_of(input.begin(), input.end(), [](const auto& entry) {
    return entry.first[0] == 'v' && entry.first[1] == '_';
  });
  require_room_for_images(queue.info, size_t(width) * size_t(height), input.count("means_t2") > 0,
                          backward, "size", source);
  const Array& means = array_named(input, "means", name);
  if (means.shape.size() != 2 || means.shape[1] != 3) refuse_shape(means, "means", name, "(N, 3)");
  SplatScene s;
  const size_t n = s.count = means.shape[0];  // all other arrays must have n rows
  s.moves = input.count("means_t2") > 0;

  const std::vector<float> places = floats(input, "means", {n, 3}, name);
  const std::vector<float> opacities = floats(input, "opacities", {n}, name);
  require_opacities(opacities, n, "opacities", source);
  const auto scales_of = [&](const char* key) {
    std::vector<float> scales = floats(input, key, {n, 3}, name);
    require_scales(scales, n, key, source);
    return scales;
  };
  s.t1.ensure(queue, n);
  s.t2.ensure(queue, n);
  s.t1.means.write(queue, places);
  s.t1.opacities.write(queue, opacities);
  s.quats = Buffer<float>(queue, floats(input, "quats", {n, 4}, name), "quats");
  s.scales = Buffer<float>(queue, scales_of("scales"), "scales");
  s.colors = Buffer<float>(queue, floats(input, "colors", {n, 3}, name), "colors");
  Posed posed(queue);
  posed.forward(queue, s.quats, s.scales, s.t1.factors);
  if (s.moves) {
    s.t2.means.write(queue, floats(input, "means_t2", {n, 3}, name));
    s.quats_t2 = Buffer<float>(queue, floats(input, "quats_t2", {n, 4}, name), "quats_t2");
    s.scales_t2 = Buffer<float>(queue, scales_of("scales_t2"), "scales_t2");
    posed.forward(queue, s.quats_t2, s.scales_t2, s.t2.factors);
  }

  const auto viewmat = floats(input, "viewmat", {4, 4}, name);
  const auto viewmat2 = floats_or(input, "viewmat_t2", {4, 4}, name, viewmat);
  const auto K = floats(input, "K", {3, 3}, name);
  const auto background = floats_or(input, "background", {3}, name, {0, 0, 0});
  require_finite(background, "background", source);
  std::copy(background.begin(), background.end(), s.background.begin());
  s.view = {camera_of(viewmat, "viewmat", K, "K", width, height, near_plane, source),
            camera_of(viewmat2, "viewmat_t2", K, "K", width, height, near_plane, source)};
  return s;
}

Arrays splat_arrays(Queue& queue, const Arrays& input, const SplatOptions& options,
                    const std::string& name) {
  const SplatScene s = splat_scene(queue, input, options.near_plane, name);
  const bool moves = s.moves;
  if (!moves && input.count("v_flow"))
    throw Error("reading " + name +
                ": v_flow needs the second time: means_t2, quats_t2, scales_t2");
  const size_t n = s.count, w = size_t(s.view.camera.width), h = size_t(s.view.camera.height);
  Posed posed(queue);
  Engine engine(queue, options.settings);
  engine.forward(queue, s.view, {moves, true}, s.background, s.t1, moves ? s.t2 : s.t1, s.colors);
  const Images& images = engine.images();
  Arrays output;
  output["rgb"] = {{h, w, 3}, from_planes(images.rgb.read(queue), 3)};
  output["alpha"] = {{h, w}, images.alpha.read(queue)};
  output["depth"] = {{h, w}, images.depth.read(queue)};
  if (moves) output["flow"] = {{h, w, 2}, from_planes(images.flow.read(queue), 2)};
  const std::vector<int32_t> broken = broken_gaussians(input, n);
  output["broken"] = {{broken.size()}, broken};

  // One backward pass per cotangent; gradients of the other images are zero.
  std::vector<Loss> losses{{"rgb", 3, &ImageGradients::v_rgb},
                           {"alpha", 1, &ImageGradients::v_alpha},
                           {"depth", 1, &ImageGradients::v_depth}};
  if (moves) losses.push_back({"flow", 2, &ImageGradients::v_flow});
  GaussianGradients g;
  Buffer<float> v_quats("v_quats"), v_scales("v_scales");
  for (const Loss& loss : losses) {
    const std::string key = "v_" + loss.key;
    if (!input.count(key)) continue;
    ImageGradients v;
    for (const Loss& other : losses) {
      (v.*other.gradient).ensure(queue, other.channels * w * h);
      (v.*other.gradient).fill(queue, 0.f);
    }
    const Shape shape = loss.channels > 1 ? Shape{h, w, loss.channels} : Shape{h, w};
    const std::vector<float> cotangent = floats(input, key, shape, name);
    require_finite(cotangent, key, source_of(name));
    (v.*loss.gradient).write(queue, to_planes(cotangent, loss.channels));
    g.zero(queue, s.count);
    engine.backward(queue, s.t1, moves ? s.t2 : s.t1, v, g);
    const std::string prefix = "g_" + loss.key + "_";
    posed.backward(queue, s.quats, s.scales, g.v_factors, v_quats, v_scales);
    output[prefix + "means"] = {{n, 3}, g.v_means.read(queue)};
    output[prefix + "quats"] = {{n, 4}, v_quats.read(queue)};
    output[prefix + "scales"] = {{n, 3}, v_scales.read(queue)};
    output[prefix + "opacities"] = {{n}, g.v_opacities.read(queue)};
    output[prefix + "colors"] = {{n, 3}, g.v_colors.read(queue)};
    if (loss.key != "flow") continue;
    posed.backward(queue, s.quats_t2, s.scales_t2, g.v_factors_t2, v_quats, v_scales);
    output[prefix + "means_t2"] = {{n, 3}, g.v_means_t2.read(queue)};
    output[prefix + "quats_t2"] = {{n, 4}, v_quats.read(queue)};
    output[prefix + "scales_t2"] = {{n, 3}, v_scales.read(queue)};
  }
  return output;
}

}  // namespace gflow
