// SPDX-License-Identifier: Apache-2.0
// `gflow splat`: the engine on arrays from a file, for scripts and for comparison with other
// implementations.
#pragma once
#include <set>

#include "optim/engine/engine.hpp"
#include "optim/formats/npz.hpp"

namespace gflow {

// Names of the arrays that are read; others are ignored.
extern const std::set<std::string> splat_arrays_known;

struct SplatOptions {
  EngineSettings settings;
  float near_plane = 0.01f;  // [scene units]
};

// The contents of a file on the device. Without means_t2 nothing moves and t2 is undefined.
struct SplatScene {
  size_t count = 0;  // N
  bool moves = false;
  View view{};
  std::array<float, 3> background{};
  Buffer<float> quats{"quats"}, scales{"scales"}, colors{"colors"};
  Buffer<float> quats_t2{"quats_t2"}, scales_t2{"scales_t2"};
  GaussiansAt t1, t2;
};

// Error that names the array if one is missing, has the wrong shape or invalid values: negative
// scales, opacities outside [0, 1], a viewmat that is not a pose. `name`: the file, for errors.
SplatScene splat_scene(Queue& queue, const Arrays& input, float near_plane,
                       const std::string& name);

// Input: means [N,3], quats [N,4] (w x y z, any length), scales [N,3] (linear), opacities [N],
// colors [N,3], viewmat [4,4] (world to camera, +z forward), K [3,3], size (W, H), background [3]
// (default 0); for flow also means_t2, quats_t2, scales_t2 and viewmat_t2 (default viewmat).
// Output: rgb [H,W,3], alpha [H,W], depth [H,W], flow [H,W,2]; for each cotangent v_rgb, v_alpha,
// v_depth, v_flow in the input the gradients g_LOSS_means|quats|scales|opacities|colors, for flow
// also g_flow_means_t2|quats_t2|scales_t2; and `broken`, the indices of Gaussians with a non-finite
// value, which are drawn without what it affects or not at all. Errors as splat_scene.
Arrays splat_arrays(Queue& queue, const Arrays& input, const SplatOptions& options,
                    const std::string& name);

}  // namespace gflow
