// SPDX-License-Identifier: Apache-2.0
// A decoded video frame as an image to look at: RGB by the stream's matrix and range, HDR (PQ) tone
// mapped, square pixels, upright.
#pragma once
#include <array>

#include "optim/images/image.hpp"
#include "optim/images/libav.hpp"

namespace gflow {

// How frames of a stream are shown: x' = across x + down y for pixel centres from the image's
// middle, for turns by multiples of 90 degrees and mirroring.
struct Orientation {
  std::array<int, 2> across{1, 0};  // where x leads: x', y'
  std::array<int, 2> down{0, 1};    // where y leads
  bool swaps_sides() const { return across[0] == 0; }
  // Clockwise turn [degrees]; 0 for mirrored frames without one.
  int degrees() const;
  bool is_mirrored() const { return across[0] * down[1] - across[1] * down[0] < 0; }
};

// From a display matrix (AV_FRAME_DATA_DISPLAYMATRIX), rounded to the nearest quarter turn.
Orientation orientation_of(const int32_t* matrix);

// Size of a frame of width x height with pixels of this aspect, upright.
struct ShownSize {
  int width, height;
};
ShownSize shown_size(int width, int height, AVRational pixel_aspect, const Orientation& turn);

// Converts frames of one stream; keeps the conversion of the last format.
class FrameConverter {
 public:
  // Straight alpha makes a fourth channel. A stream without a matrix counts as BT.601, without a
  // range as limited, as in the ffmpeg program. HLG is shown as it is, as it was made to be on
  // screens without HDR. Error for sizes above largest_side and for formats that FFmpeg cannot
  // convert; `path` is named in it.
  Image image(const AVFrame& frame, AVRational pixel_aspect, const Orientation& turn,
              const std::string& path);

 private:
  LibavPointer<SwsContext> scaler_;
  std::array<int, 7> format_{};  // what the scaler was made for
};

// Whether frames of that pixel format have alpha.
bool has_alpha(AVPixelFormat format);

// Light above reference white (203 cd/m2, ITU-R BT.2408) compressed into the range of a screen
// without HDR: rgb [n, 3] of PQ code values with BT.2020 primaries, 16 bit, to sRGB of 8 bit.
void tone_map_pq(const uint16_t* rgb, size_t pixels, uint8_t* out);

}  // namespace gflow
