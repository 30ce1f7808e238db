// SPDX-License-Identifier: Apache-2.0
// A model as the bytes that the viewer's page draws: 8 bytes "GFLOWVM1", u32 length H of a header,
// the header, JSON padded with spaces so that 12 + H is a multiple of 8, then arrays. Everything is
// little-endian. apps/viewer/README.md lists header and arrays.
#pragma once
#include <string>

#include "apps/viewer/baked_poses.hpp"
#include "optim/engine/settings.hpp"

namespace gflow {

// What a viewer needs to know besides the model.
struct ViewFacts {
  size_t steps = 0;    // time steps of the scene; 0: unknown
  double fps = 0;      // frames per second; 0: unknown
  double near = 0.05;  // near plane [scene units]
  double extent = 1;   // size of the scene [scene units]
  std::array<float, 3> background = {1, 1, 1};
  std::array<double, 3> up = {0, -1, 0};  // direction in the world
  StopRule stop = StopRule::include;
  Transport transport = Transport::material;
};

// full: float32, as in the model. half, for files: colours as float16, baked poses and keys as 16
// bits between their least and greatest values, all in the order of bytes that compresses best.
enum class ViewPrecision { full, half };

// poses: those of a model that needs_poses(); else nullptr.
std::string view_model_bytes(const HostModel& model, const BakedPoses* poses,
                             const ViewFacts& facts, ViewPrecision precision = ViewPrecision::full);

// Half the diagonal of the box of the means, without 2 % on each side of each axis; 1 for an empty
// model.
double extent_of(const HostModel& model);

}  // namespace gflow
