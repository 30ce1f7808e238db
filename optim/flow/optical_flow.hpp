// SPDX-License-Identifier: Apache-2.0
// Target flow by OpenCV's DIS, with a forward-backward check for confidence.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "optim/formats/flo.hpp"
#include "optim/images/image.hpp"

namespace gflow {

// A target flow and its confidence.
struct TargetFlow {
  FlowField flow;
  std::vector<uint8_t> confidence;  // [height, width]; 255: consistent, 0: not or unknown
  float emphasis = 1;               // weight of each pixel in the flow loss
};

// Whether the camera of two images stands still: then nothing moves outside of changed_regions(),
// where flow is 0 without being computed.
enum class CameraMotion { none, any };

// 255 where |f(x) + b(x + f(x))| < max(0.5 px, 5 % of |f|) with b sampled bilinearly; 0 elsewhere,
// where f leaves the image, and where f or b is invalid.
std::vector<uint8_t> consistency(const FlowField& forward, const FlowField& backward);

// Flow and confidence for a pair of images (RGB, same size), from a to b and from b to a. DIS at
// scale 0 with patches of 8 and stride 1. Uses one thread, so the result does not depend on their
// number.
std::pair<TargetFlow, TargetFlow> estimate_target_flows(const Image& a, const Image& b,
                                                        CameraMotion camera);

// The same for a moving camera with patches at a stride of 4 and fewer iterations: ten times faster
// and less exact at silhouettes.
std::pair<TargetFlow, TargetFlow> estimate_quick_flows(const Image& a, const Image& b);

// A flow resampled to another size, with scaled vectors. Uses the nearest sample, because averaging
// across a silhouette gives a motion of no surface.
TargetFlow resized(const TargetFlow& target_flow, int width, int height);

}  // namespace gflow
