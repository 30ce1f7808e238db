// SPDX-License-Identifier: Apache-2.0
// gflow.rasterization() on plain memory: Gaussians and a batch of cameras to images, and gradients
// of images to gradients of everything. Knows nothing about Python.
#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "apps/python/devices.hpp"

namespace gflow::python {

constexpr float kLeastAlpha = 1e-10f;  // expected depth is depth / max(alpha, this)

// An argument with a value that it cannot have.
struct InputError : Error {
  using Error::Error;
};

// N Gaussians at two times, C cameras. Row by row; nullptr where optional and not given.
struct RasterizationInput {
  size_t gaussians = 0, cameras = 0;  // N, C
  int width = 0, height = 0;          // [px]
  float near_plane = 0.01f;           // [scene units]
  bool depth = false;                 // a depth after the colours
  bool expected_depth = false;        // that depth is divided by alpha
  bool gradients = false;             // backward() will be called
  bool flow = false;                  // then all arrays of the second time are given
  int sh_degree = -1;                 // colours are spherical harmonics; -1: they are not
  size_t coefficients = 1;            // K, per Gaussian, at least (sh_degree + 1)^2
  bool colors_per_camera = false;
  const float* means = nullptr;      // [N, 3]
  const float* quats = nullptr;      // [N, 4] w x y z, of any length
  const float* scales = nullptr;     // [N, 3]
  const float* opacities = nullptr;  // [N]
  const float* colors = nullptr;     // [N, 3] or [N, K, 3], for each camera if per camera
  const float* means_t2 = nullptr;   // the second time
  const float* quats_t2 = nullptr;
  const float* scales_t2 = nullptr;
  const float* viewmats = nullptr;  // [C, 4, 4] world to camera
  const float* viewmats_t2 = nullptr;
  const float* Ks = nullptr;           // [C, 3, 3]
  const float* backgrounds = nullptr;  // [C, 3]; optional, black
  EngineSettings settings;

  size_t channels() const { return depth ? 4 : 3; }  // X
  size_t pixels() const { return size_t(width) * size_t(height); }
};

// Where to write. nullptr: not wanted.
struct RasterizationOutput {
  float* colors = nullptr;   // [C, H, W, X]
  float* alphas = nullptr;   // [C, H, W]
  float* flow = nullptr;     // [C, H, W, 2] [px]
  float* means2d = nullptr;  // [C, N, 2] [px]; these are 0 for Gaussians that are not visible
  float* depths = nullptr;   // [C, N] camera z
  float* conics = nullptr;   // [C, N, 3] a b c of the inverse covariance [1/px^2]
  int32_t* radii = nullptr;  // [C, N, 2] half size of the box where alpha >= 1/255 [px]
  int32_t* tiles = nullptr;  // [C, N] tiles touched
};

// Gradients of the images, nullptr: 0. In the sizes of the output.
struct ImageCotangents {
  const float *colors = nullptr, *alphas = nullptr, *flow = nullptr;
};

// Gradients of the arrays of RasterizationInput, in their sizes. nullptr: not wanted. Those of
// viewmats are along rigid motions of the camera.
struct RasterizationGradients {
  float *means = nullptr, *quats = nullptr, *scales = nullptr, *opacities = nullptr;
  float *colors = nullptr, *means_t2 = nullptr, *quats_t2 = nullptr, *scales_t2 = nullptr;
  float *viewmats = nullptr, *viewmats_t2 = nullptr;
  float* means2d = nullptr;  // [C, N, 2], of colours, alpha and depth only
};

// The forward pass and, on the device, what the backward pass needs.
class Rasterization {
 public:
  // Checks the input and uploads it. The arrays are not needed afterwards. Throws InputError.
  Rasterization(Device& device, const RasterizationInput& input);

  // `between` is called after each view, without the device's lock; it may throw to stop.
  void forward(const RasterizationOutput& output, const std::function<void()>& between);
  // Any number of times after forward(), by any thread.
  void backward(const ImageCotangents& v, const RasterizationGradients& gradients,
                const std::function<void()>& between);

  // Gaussians with a non-finite value, which are drawn without what it affects or not at all.
  const std::vector<int32_t>& broken() const { return broken_; }
  const RasterizationInput& input() const { return input_; }  // its arrays may be gone

 private:
  struct Colors {
    Buffer<float> shown{"colors"};          // [N, 3]
    std::unique_ptr<Parameters> harmonics;  // nullptr: `shown` is the input
  };

  void check();
  void upload();
  Colors upload_colors(const float* colors);
  Colors& colors_of(size_t camera) { return colors_[input_.colors_per_camera ? camera : 0]; }
  Bands bands() const { return {input_.sh_degree, input_.sh_degree}; }
  const GaussiansAt& second() const { return input_.flow ? g_->t2 : g_->t1; }
  void read_images(size_t camera, const RasterizationOutput& output);
  void read_geometry(size_t camera, const RasterizationOutput& output);
  void write_cotangents(size_t camera, const ImageCotangents& v);
  // Adds the colours' gradient by the means; returns that by the camera's centre, if by_camera.
  std::array<double, 3> color_backward(size_t camera, bool first, bool by_camera);
  void read_camera_gradients(size_t camera, const RasterizationGradients& gradients,
                             const std::array<double, 3>& v_centre);
  void read_color_gradients(const RasterizationGradients& gradients);

  Device& device_;
  RasterizationInput input_;
  std::vector<int32_t> broken_;
  std::vector<View> views_;
  std::vector<std::array<float, 3>> backgrounds_;
  Device::Loan<Device::Gaussians> g_;
  std::vector<Colors> colors_;  // their gradients are those of one backward() at a time
  std::mutex backward_mutex_;
  std::vector<Device::Loan<Engine>> engines_;  // one per camera
};

}  // namespace gflow::python
