// SPDX-License-Identifier: Apache-2.0
// The backward pass of a Rasterization.
#include <algorithm>

#include "apps/python/rasterization.hpp"

namespace gflow::python {
namespace {

using Vec3 = std::array<double, 3>;

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Writes the part of an interleaved image that one view has as planes, through `host`.
void write_planes(Queue& queue, const float* image, size_t pixels, size_t stride, size_t channels,
                  std::vector<float>& host, Buffer<float>& to) {
  if (host.size() < pixels * channels) host.resize(pixels * channels);
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < channels; ++c) host[c * pixels + i] = image[i * stride + c];
  to.write_from(queue, host.data());
}

// Copies the values of the first view, adds those of others. nullptr: not wanted.
void take(Device& device, const Buffer<float>& buffer, float* into, bool first) {
  if (!into) return;
  if (first) return buffer.read_to(device.queue, into);
  const float* values = device.read(buffer);
  for (size_t i = 0; i < buffer.size(); ++i) into[i] += values[i];
}

// The gradient by a viewmat [4, 4], given that by moves p' = exp([rotation]) p + translation of
// the camera. It has no part across rigid motions: any viewmat is a rotation and translation.
void viewmat_gradient(const PinholeCamera& camera, const CameraSums& sums, const Vec3& v_centre,
                      float* v_viewmat) {
  const float* R = camera.rotation;
  const Vec3 t{camera.translation[0], camera.translation[1], camera.translation[2]};
  Vec3 v_t{sums[3], sums[4], sums[5]};  // the centre -R^T t moves by -R^T translation
  for (size_t row = 0; row < 3; ++row)
    for (size_t k = 0; k < 3; ++k) v_t[row] -= double(R[3 * row + k]) * v_centre[k];
  const Vec3 moved = cross(t, v_t);  // a rotation also turns t
  const Vec3 w{sums[0] - moved[0], sums[1] - moved[1], sums[2] - moved[2]};
  std::fill_n(v_viewmat, 16, 0.f);
  for (size_t col = 0; col < 3; ++col) {
    const Vec3 column = cross(w, {R[col], R[3 + col], R[6 + col]});
    for (size_t row = 0; row < 3; ++row) v_viewmat[4 * row + col] = float(column[row] / 2);
  }
  for (size_t row = 0; row < 3; ++row) v_viewmat[4 * row + 3] = float(v_t[row]);
}

}  // namespace

void Rasterization::write_cotangents(size_t camera, const ImageCotangents& v) {
  Queue& queue = device_.queue;
  const Images& images = engines_[camera]->images();
  const size_t pixels = input_.pixels(), stride = input_.channels();
  ImageGradients& to = device_.v_images;
  std::vector<float>& host = device_.host;
  to.zero(queue, images, input_.flow, input_.depth);
  to.flow_in_parts = !v.flow;
  if (v.colors)
    write_planes(queue, v.colors + camera * pixels * stride, pixels, stride, 3, host, to.v_rgb);
  if (v.flow) write_planes(queue, v.flow + camera * pixels * 2, pixels, 2, 2, host, to.v_flow);
  const float* v_alphas = v.alphas ? v.alphas + camera * pixels : nullptr;
  if (!v.colors || !input_.depth) {
    if (v_alphas) to.v_alpha.write_from(queue, v_alphas);
    return;
  }
  const float* v_depths = v.colors + camera * pixels * stride + 3;
  if (!input_.expected_depth) {
    write_planes(queue, v_depths, pixels, stride, 1, host, to.v_depth);
    if (v_alphas) to.v_alpha.write_from(queue, v_alphas);
    return;
  }
  const std::vector<float> depth = images.depth.read(queue), alpha = images.alpha.read(queue);
  std::vector<float> v_depth(pixels), v_alpha(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const bool drawn = alpha[i] > kLeastAlpha;
    v_depth[i] = drawn ? v_depths[stride * i] / alpha[i] : 0;
    v_alpha[i] = (v_alphas ? v_alphas[i] : 0) - (drawn ? v_depth[i] * (depth[i] / alpha[i]) : 0);
  }
  to.v_depth.write(queue, v_depth);
  to.v_alpha.write(queue, v_alpha);
}

void Rasterization::backward(const ImageCotangents& v, const RasterizationGradients& to,
                             const std::function<void()>& between) {
  Queue& queue = device_.queue;
  const size_t n = input_.gaussians;
  if (!input_.gradients || engines_.size() != input_.cameras)
    throw Error("rasterization: there is no forward pass to go back from");
  const std::lock_guard<std::mutex> one(backward_mutex_);
  GaussianGradients& g = device_.gradients;
  for (size_t c = 0; c < input_.cameras; ++c) {
    {
      const std::lock_guard<std::mutex> lock(device_.mutex);
      const bool first = c == 0;
      Engine& engine = *engines_[c];
      write_cotangents(c, v);
      g.zero(queue, n);
      engine.backward(queue, g_->t1, second(), device_.v_images, g);
      if (to.means2d) g.v_means2d.read_to(queue, to.means2d + 2 * n * c);
      const bool by_camera = to.viewmats || to.viewmats_t2;
      if (by_camera)
        device_.camera_gradients.start(queue, views_[c], input_.flow, engine.splats(), g_->t1,
                                       second(), g);
      const Vec3 v_centre = color_backward(c, first, by_camera);
      if (by_camera) read_camera_gradients(c, to, v_centre);
      take(device_, g.v_means, to.means, first);
      take(device_, g.v_opacities, to.opacities, first);
      if (!colors_of(c).harmonics && to.colors) {
        const size_t at = input_.colors_per_camera ? 3 * n * c : 0;
        take(device_, g.v_colors, to.colors + at, first || input_.colors_per_camera);
      }
      if (to.quats || to.scales) {
        device_.posed.backward(queue, g_->quats, g_->scales, g.v_factors, device_.v_quats,
                               device_.v_scales);
        take(device_, device_.v_quats, to.quats, first);
        take(device_, device_.v_scales, to.scales, first);
      }
      if (input_.flow) take(device_, g.v_means_t2, to.means_t2, first);
      if (input_.flow && (to.quats_t2 || to.scales_t2)) {
        device_.posed.backward(queue, g_->quats_t2, g_->scales_t2, g.v_factors_t2, device_.v_quats,
                               device_.v_scales);
        take(device_, device_.v_quats, to.quats_t2, first);
        take(device_, device_.v_scales, to.scales_t2, first);
      }
    }
    between();
  }
  const std::lock_guard<std::mutex> lock(device_.mutex);
  read_color_gradients(to);
}

std::array<double, 3> Rasterization::color_backward(size_t camera, bool first, bool by_camera) {
  Colors& colors = colors_of(camera);
  Vec3 v_centre{};
  if (!colors.harmonics) return v_centre;
  Queue& queue = device_.queue;
  Parameters& p = *colors.harmonics;
  if (first || input_.colors_per_camera) {
    p.rows.seen.fill(queue, 1);  // gradients of all views are added to 0
    p["sh0"].grads.fill(queue, 0);
    p["sh_rest"].grads.fill(queue, 0);
  }
  GaussianGradients& g = device_.gradients;
  Color& color = device_.color(input_.sh_degree);
  const Buffer<cl_uint>& touched = engines_[camera]->splats().tiles_touched;
  if (!by_camera || input_.sh_degree == 0) {
    color.backward(queue, p, bands(), views_[camera].camera, g_->t1, touched, g);
    return v_centre;
  }
  // The direction of view also depends on the camera: its part is summed before it is added.
  GaussianGradients& part = device_.through_direction;
  const size_t n = input_.gaussians;
  part.v_means.ensure(queue, 3 * n);
  part.v_means.fill(queue, 0);
  part.v_colors.swap_memory(g.v_colors);
  color.backward(queue, p, bands(), views_[camera].camera, g_->t1, touched, part);
  part.v_colors.swap_memory(g.v_colors);
  const std::vector<float> v_directions = part.v_means.read(queue);
  std::vector<float> v_means = g.v_means.read(queue);
  for (size_t i = 0; i < 3 * n; ++i) {
    v_centre[i % 3] -= double(v_directions[i]);
    v_means[i] += v_directions[i];
  }
  g.v_means.write(queue, v_means);
  return v_centre;
}

void Rasterization::read_camera_gradients(size_t camera, const RasterizationGradients& to,
                                          const std::array<double, 3>& v_centre) {
  const std::vector<CameraSums> sums = device_.camera_gradients.take(device_.queue);
  const View& view = views_[camera];
  if (to.viewmats) viewmat_gradient(view.camera, sums[0], v_centre, to.viewmats + 16 * camera);
  if (to.viewmats_t2 && input_.flow)
    viewmat_gradient(view.camera_t2, sums[1], {}, to.viewmats_t2 + 16 * camera);
}

void Rasterization::read_color_gradients(const RasterizationGradients& to) {
  if (!to.colors || input_.sh_degree < 0) return;
  Queue& queue = device_.queue;
  const size_t n = input_.gaussians, stride = 3 * input_.coefficients;
  for (size_t set = 0; set < colors_.size(); ++set) {
    Parameters& p = *colors_[set].harmonics;
    const size_t rest = p["sh_rest"].width;
    const std::vector<float> first = p["sh0"].grads.read(queue);
    const std::vector<float> others = p["sh_rest"].grads.read(queue);
    float* v = to.colors + set * n * stride;
    for (size_t i = 0; i < n; ++i, v += stride) {
      std::copy_n(first.begin() + ptrdiff_t(3 * i), 3, v);
      std::copy_n(others.begin() + ptrdiff_t(rest * i), rest, v + 3);
      std::fill_n(v + 3 + rest, stride - 3 - rest, 0.f);
    }
  }
}

}  // namespace gflow::python
