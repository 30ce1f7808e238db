// SPDX-License-Identifier: Apache-2.0
// Optical flow in memory and as Middlebury .flo files. A vector [px] (u right, v down) points from
// a pixel of this image to the position of the same surface point in the next image.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace gflow {

// Flow per pixel.
struct FlowField {
  int width = 0, height = 0;   // [px]
  std::vector<float> uv;       // [height, width, 2]; 0 where invalid
  std::vector<uint8_t> valid;  // [height, width]; 1 if the flow is known, else 0
};

// Flow drawn as an RGB image, [height, width, 3].
struct FlowImage {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

// Zero flow, valid everywhere.
FlowField zero_flow(int width, int height);

// Reads .flo or .flo.gz. Non-finite components and magnitudes above 1e9 mark a pixel as invalid.
// Error if the tag, the size or the file length is wrong.
FlowField read_flo(const std::string& path);

// Writes .flo, gzipped when path ends in .gz. Invalid pixels are stored as 1e10.
void write_flo(const std::string& path, const FlowField& flow);

// Middlebury colour code: hue is the direction, saturation the length divided by `longest` [px] (<=
// 0: the longest valid flow). Zero flow is white, invalid pixels are black, flow above `longest` is
// darkened.
FlowImage color_wheel(const FlowField& flow, float longest = 0);

}  // namespace gflow
