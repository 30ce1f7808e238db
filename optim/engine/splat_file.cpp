// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/splat_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/engine/posed.hpp"

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

// Values of N Gaussians, each finite one in [0, most]. Non-finite values are allowed, because they
// only affect their own Gaussian.
std::vector<float> floats_up_to(float most, const char* expected, const Arrays& input,
                                const std::string& key, const Shape& shape,
                                const std::string& name) {
  std::vector<float> values = floats(input, key, shape, name);
  for (size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i]) && !(values[i] >= 0 && values[i] <= most))
      throw Error(fmt::format("reading {}: array '{}' has {} for Gaussian {}, expected {}", name,
                              key, values[i], i * shape[0] / values.size(), expected));
  return values;
}
std::vector<float> scales_of(const Arrays& input, const std::string& key, size_t n,
                             const std::string& name) {
  return floats_up_to(HUGE_VALF, "lengths of at least 0, not logarithms", input, key, {n, 3}, name);
}

// A viewmat: rotation and translation.
std::vector<float> pose_of(const Arrays& input, const std::string& key, const std::string& name) {
  const std::vector<float> m = floats(input, key, {4, 4}, name);
  for (const float x : m)
    if (!std::isfinite(x))
      throw Error(fmt::format("reading {}: camera pose '{}' contains NaN or Inf", name, key));
  constexpr float tolerance = 1e-3f;  // poses are written with few digits
  bool turns = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b <= a; ++b) {
      const float product =
          m[4 * a] * m[4 * b] + m[4 * a + 1] * m[4 * b + 1] + m[4 * a + 2] * m[4 * b + 2];
      turns = turns && std::fabs(product - float(a == b)) < tolerance;
    }
  const float determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                            m[1] * (m[4] * m[10] - m[6] * m[8]) +
                            m[2] * (m[4] * m[9] - m[5] * m[8]);  // < 0: a reflection
  if (!(turns && determinant > 0))
    throw Error(
        fmt::format("reading {}: camera pose '{}' should be a world-to-camera rotation and "
                    "translation with last row 0 0 0 1",
                    name, key));
  return m;
}

PinholeCamera camera_of(const std::vector<float>& viewmat, const std::vector<float>& K, int width,
                        int height, float near_plane) {
  PinholeCamera camera{};
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) camera.rotation[3 * row + col] = viewmat[4 * row + col];
    camera.translation[row] = viewmat[4 * row + 3];
  }
  camera.fx = K[0];
  camera.fy = K[4];
  camera.cx = K[2];
  camera.cy = K[5];
  camera.near_plane = near_plane;
  camera.width = width;
  camera.height = height;
  return camera;
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
       {"means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2"}) {
    if (!input.count(key)) continue;
    const std::vector<float> values = input.at(key).as_float();
    for (size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i])) broken[i * n / values.size()] = 1;
  }
  std::vector<int32_t> numbers;
  for (size_t i = 0; i < n; ++i)
    if (broken[i]) numbers.push_back(int32_t(i));
  return numbers;
}

// An output image: its name, channels and cotangent.
struct Loss {
  std::string key;
  size_t channels;
  Buffer<float> ImageGradients::*gradient;
};

// Error if a value is not finite; it would reach every pixel.
void require_finite(const std::vector<float>& values, const std::string& key,
                    const std::string& name) {
  for (const float x : values)
    if (!std::isfinite(x))
      throw Error(fmt::format("reading {}: array '{}' contains NaN or Inf", name, key));
}

// Error if the device cannot hold the images and their cotangents. On a CPU the same memory also
// holds the arrays read and written.
void require_room_for_images(const DeviceInfo& device, size_t pixels, const Arrays& input,
                             const std::string& name) {
  const bool moves = input.count("means_t2") > 0;
  const bool backward = std::any_of(input.begin(), input.end(), [](const auto& entry) {
    return entry.first[0] == 'v' && entry.first[1] == '_';
  });
  const size_t shown = 3 + 1 + 1 + (moves ? 2 : 0);          // rgb, alpha, depth, flow
  const size_t floats = shown + 1 + (backward ? shown : 0);  // and transmittance
  const size_t largest = 3 * sizeof(float) * pixels, all = floats * sizeof(float) * pixels;
  const auto mib = [](uint64_t bytes) { return double(bytes) / (1 << 20); };
  constexpr uint64_t copies = 3;
  if (all > device.global_memory / copies)
    throw Error(
        fmt::format("reading {}: images of the size in array 'size' need {:.1f} MiB, three times "
                    "that until they are written, but {} has {:.1f} MiB",
                    name, mib(all), device.full_name(), mib(device.global_memory)));
  if (largest > device.max_allocation)
    throw Error(
        fmt::format("reading {}: an image of the size in array 'size' needs {:.1f} MiB, but {} "
                    "allocates at most {:.1f} MiB at once",
                    name, mib(largest), device.full_name(), mib(device.max_allocation)));
}

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
  const std::vector<double> sides = size.as_double();
  for (const double side : sides)
    if (!(side >= 1 && side <= 65535 && side == std::floor(side)))
      throw Error(fmt::format(
          "reading {}: array 'size' is {} x {} pixels, each should be a whole number, 1 to 65535",
          name, sides[0], sides[1]));
  const int width = int(sides[0]), height = int(sides[1]);
  require_room_for_images(queue.info, size_t(width) * size_t(height), input, name);
  const Array& means = array_named(input, "means", name);
  if (means.shape.size() != 2 || means.shape[1] != 3) refuse_shape(means, "means", name, "(N, 3)");
  SplatScene s;
  const size_t n = s.count = means.shape[0];  // all other arrays must have n rows
  s.moves = input.count("means_t2") > 0;

  const std::vector<float> places = floats(input, "means", {n, 3}, name);
  const std::vector<float> opacities =
      floats_up_to(1, "opacities from 0 to 1, not logits", input, "opacities", {n}, name);
  s.t1.ensure(queue, n);
  s.t2.ensure(queue, n);
  s.t1.means.write(queue, places);
  s.t1.opacities.write(queue, opacities);
  s.quats = Buffer<float>(queue, floats(input, "quats", {n, 4}, name), "quats");
  s.scales = Buffer<float>(queue, scales_of(input, "scales", n, name), "scales");
  s.colors = Buffer<float>(queue, floats(input, "colors", {n, 3}, name), "colors");
  Posed posed(queue);
  posed.forward(queue, s.quats, s.scales, s.t1.factors);
  if (s.moves) {
    s.t2.means.write(queue, floats(input, "means_t2", {n, 3}, name));
    s.quats_t2 = Buffer<float>(queue, floats(input, "quats_t2", {n, 4}, name), "quats_t2");
    s.scales_t2 = Buffer<float>(queue, scales_of(input, "scales_t2", n, name), "scales_t2");
    posed.forward(queue, s.quats_t2, s.scales_t2, s.t2.factors);
  }

  const auto viewmat = pose_of(input, "viewmat", name);
  const auto viewmat2 = input.count("viewmat_t2") ? pose_of(input, "viewmat_t2", name) : viewmat;
  const auto K = floats(input, "K", {3, 3}, name);
  const auto background = floats_or(input, "background", {3}, name, {0, 0, 0});
  require_finite(background, "background", name);
  std::copy(background.begin(), background.end(), s.background.begin());
  if (!(std::isfinite(K[2]) && std::isfinite(K[5]) && K[0] > 0 && K[4] > 0 && std::isfinite(K[0]) &&
        std::isfinite(K[4])))
    throw Error("reading " + name +
                ": K should hold two focal lengths above 0 and a finite centre");
  if (K[1] != 0 || K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw Error("reading " + name + ": K should be fx 0 cx, 0 fy cy, 0 0 1: skew is not supported");
  s.view = {camera_of(viewmat, K, width, height, near_plane),
            camera_of(viewmat2, K, width, height, near_plane)};
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
    require_finite(cotangent, key, name);
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
