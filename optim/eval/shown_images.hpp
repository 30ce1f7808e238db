// SPDX-License-Identifier: Apache-2.0
// Images to be looked at, and arrays for scripts, made from the engine's float planes.
#pragma once
#include <string>
#include <vector>

#include "optim/images/image.hpp"

namespace gflow {

// [3, H, W] in [0, 1] as RGB; values outside are clamped.
Image image_of_rgb(int width, int height, const std::vector<float>& planes);
// [H, W] in [0, 1] as grey.
Image image_of_alpha(int width, int height, const std::vector<float>& plane);

// Expected depth of a ray, sum(w z) / sum(w), along the camera's z axis [scene units]; 0 where
// alpha is 0.
std::vector<float> expected_depth(const std::vector<float>& depth, const std::vector<float>& alpha);

// Depth as 16-bit counts: depth = count x unit, 0 where alpha is 0. The unit is the smallest of 1,
// 2, 5 x 10^k that holds the largest depth, so neighbouring frames share one. Depths above 0 have a
// count of at least 1.
struct DepthCounts {
  double unit = 1;  // [scene units]
  std::vector<uint16_t> counts;
};
DepthCounts count_depth(const std::vector<float>& depth);

// [2, H, W] as a flow field, valid where alpha is at least 1/255, which an 8-bit image can show.
FlowField flow_of_planes(int width, int height, const std::vector<float>& planes,
                         const std::vector<float>& alpha);
// The Middlebury colour code; flows of `longest` [px] have full saturation.
Image image_of_flow(const FlowField& flow, float longest);
// Length that all but the share `share` of valid flow vectors stay below [px]; 0 if none is valid.
float flow_length_above(const FlowField& flow, double share);

// |a - b| x gain, clamped to 255. Error if sizes differ.
Image error_image(const Image& a, const Image& b, int gain);
// Images side by side, from the left. Error if heights differ.
Image side_by_side(const std::vector<Image>& images);

}  // namespace gflow
