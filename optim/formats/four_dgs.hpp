// SPDX-License-Identifier: Apache-2.0
// .4dgs files (avala-ai/4dgs, format version 1, temporal model "gaussian-birth"): Gaussians on
// straight lines with constant rotation and scale. Each has a mean time, a temporal standard
// deviation and a time window outside of which it is invisible. A curved path is a sequence of such
// pieces.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "optim/formats/ply.hpp"

namespace gflow {

// Visible at time t in [begin, end) if weight = exp(-(t - mean_t)^2 / (2 life^2)) >= the scene's
// cutoff. Its mean is then mean + velocity (t - mean_t), its opacity is opacity * weight. Times are
// in seconds.
struct MovingSplat {
  std::array<double, 3> mean{};            // at mean_t, which may be outside the window
  std::array<double, 3> velocity{};        // [scene units/s]
  std::array<double, 3> scales{};          // > 0
  std::array<double, 4> quat{1, 0, 0, 0};  // w x y z
  std::array<double, 3> color{};           // degree 0, [0, 1]
  double opacity = 0;                      // [0, 1]
  double mean_t = 0;                       // [s]
  double life = std::numeric_limits<double>::infinity();  // [s]; infinite: weight 1 throughout
  double begin = 0, end = 0;                              // [s]
  size_t sh_row = 0;                                      // row of sh_rest
};

// Initial camera of a viewer.
struct Viewpoint {
  double fov_y = 50;  // [degrees]
  std::array<double, 3> position{}, target{};
};

struct MovingSplats {
  double duration = 0;   // playback range is [0, duration) [s]
  double cutoff = 0.05;  // in (0, 1]
  int sh_degree = 0;     // 0 to 3
  std::vector<MovingSplat> splats;
  std::vector<float> sh_rest;  // [rows, 3, K - 1], channel by channel; K = (sh_degree + 1)^2
  // Only written, not read: upwards, if known, and frames per second, if > 0, as metadata of the
  // header; the initial camera, and the positions of the training cameras.
  std::optional<std::array<double, 3>> up;
  double fps = 0;
  Viewpoint viewpoint;
  std::vector<std::array<double, 3>> eyes;
};

// Whether a file with these first bytes is a .4dgs file of any version.
bool is_four_dgs(const std::string& first_bytes);

// Quantizes all values. Largest errors: positions 1/50 of the median Gaussian size, relative errors
// of scales and lives 1/400, stored quaternion components 1/2000, opacities 1/1020. SH coefficients
// are clamped to [-4, 4] and stored in steps of 8/255, rounded so that the colours seen from `eyes`
// change least. Error if a value is not finite or the scene is too large for the grid.
void write_four_dgs(const std::string& path, const MovingSplats& scene);

// Error if the file is damaged or truncated, or its version, temporal model, quantization or
// compression is not supported.
MovingSplats read_four_dgs(const std::string& path);

// The Gaussians visible at a time [s], as a standard 3DGS PLY.
PlyTable splats_at(const MovingSplats& scene, double time);

}  // namespace gflow
