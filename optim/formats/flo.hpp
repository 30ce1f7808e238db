// SPDX-License-Identifier: Apache-2.0
// Optical flow in memory and as Middlebury .flo files. Flow is in pixels: u to the right, v down,
// from a pixel of this picture to where its surface is in the next one.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace gflow {

// A flow for each pixel of a picture.
struct FlowField {
  int width = 0, height = 0;   // [px]
  std::vector<float> uv;       // [height, width, 2]; 0 where not valid
  std::vector<uint8_t> valid;  // [height, width] 1 where the flow is known, else 0
};

// An RGB picture of flow, [height, width, 3].
struct FlowPicture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

// A flow of that size with uv = 0, everywhere valid.
FlowField zero_flow(int width, int height);

// Reads .flo or .flo.gz. Values that are not finite or beyond 1e9 mean "unknown" and become
// invalid. Error when the tag, the size or the length is not that of a .flo file.
FlowField read_flo(const std::string& path);

// Writes .flo, gzipped when path ends in .gz. Invalid pixels are stored as 1e10.
void write_flo(const std::string& path, const FlowField& flow);

// The Middlebury colour code: hue is the direction, saturation the length relative to
// `longest` [px] (<= 0: the longest valid flow), white is rest, black is unknown. Longer flows are
// darkened.
FlowPicture color_wheel(const FlowField& flow, float longest = 0);

}  // namespace gflow
