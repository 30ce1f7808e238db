// SPDX-License-Identifier: Apache-2.0
// .4dgs files (avala-ai/4dgs, format version 1, temporal model "gaussian-birth"): Gaussians on
// straight lines that neither turn nor change size, each with a moment, a life and a window of time
// outside of which it is not there. A path that bends is a row of such pieces.
#pragma once
#include <array>
#include <cstdint>
#include <limits>

#include "optim/formats/ply.hpp"

namespace gflow {

// At time t in [begin, end), where weight = exp(-(t - mean_t)^2 / (2 life^2)) >= the scene's
// cutoff: mean + velocity (t - mean_t), with opacity * weight. Times in seconds.
struct MovingSplat {
  std::array<double, 3> mean{};            // at mean_t, which may lie outside of the window
  std::array<double, 3> velocity{};        // [scene units/s]
  std::array<double, 3> scales{};          // > 0
  std::array<double, 4> quat{1, 0, 0, 0};  // w x y z
  std::array<double, 3> color{};           // of degree 0, [0, 1]
  double opacity = 0;                      // [0, 1]
  double mean_t = 0;                       // [s]
  double life = std::numeric_limits<double>::infinity();  // [s]; infinite: never fades
  double begin = 0, end = 0;                              // [s]
  size_t sh_row = 0;                                      // of sh_rest
};

// Where a viewer may begin.
struct Viewpoint {
  double fov_y = 50;  // [degrees]
  std::array<double, 3> position{}, target{};
};

struct MovingSplats {
  double duration = 0;   // what a player plays: [0, duration) [s]
  double cutoff = 0.05;  // in (0, 1]
  int sh_degree = 0;     // 0 to 3
  std::vector<MovingSplat> splats;
  std::vector<float> sh_rest;  // [rows, 3, K - 1] channel by channel, K = (sh_degree + 1)^2
  // What is written only: where viewers begin, and from where the scene was seen.
  Viewpoint viewpoint;
  std::vector<std::array<double, 3>> eyes;
};

// Whether these are the first bytes of such a file, of any version.
bool is_four_dgs(const std::string& first_bytes);

// Values lie on grids: positions to a fiftieth of a usual Gaussian's size, scales and lives to
// 1/400, turns to 1/2000, colours and opacities to 1/1020, coefficients of spherical harmonics to
// 1/64, those outside of [-4, 4] cut off; these are rounded so that the colours seen from the eyes
// change least. Error when a value is not finite or the scene too large
// for such a grid.
void write_four_dgs(const std::string& path, const MovingSplats& scene);

// Error when the file is damaged, ends early, or has another version, temporal model, grid or
// compression than gflow reads.
MovingSplats read_four_dgs(const std::string& path);

// What is there at a time [s], as a standard 3DGS PLY.
PlyTable splats_at(const MovingSplats& scene, double time);

}  // namespace gflow
